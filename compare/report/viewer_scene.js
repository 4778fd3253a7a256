// The scene in 3-D, camera frame (x right, y up, z toward the viewer), mm: triangles with a normal and a colour.
const SCENE_VERTEX = `attribute vec3 place, normal, colour; uniform mat4 view; varying vec3 shade;
void main() { gl_Position = view * vec4(place, 1); shade = colour * (0.35 + 0.65 * max(0.0, normalize(normal).z)); }`;
const SCENE_FRAGMENT = "precision mediump float; varying vec3 shade; void main() { gl_FragColor = vec4(shade, 1); }";
const ENLARGED = 10;

// An ellipsoid: half-axes (three vectors) about a centre.
function ellipsoid(into, centre, axes, colour) {
  const at = (i, j) => {
    const a = i / 12 * Math.PI, b = j / 12 * 2 * Math.PI, unit = [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)];
    return { place: centre.map((c, k) => c + dot(unit, axes.map((axis) => axis[k]))), normal: unit };
  };
  for (let i = 0; i < 12; i++) for (let j = 0; j < 12; j++) {
    for (const [p, q] of [[i, j], [i + 1, j], [i, j + 1], [i, j + 1], [i + 1, j], [i + 1, j + 1]]) {
      const { place, normal } = at(p, q);
      into.push(...place, ...normal, ...colour);
    }
  }
}
const ball = (into, centre, radius, colour) =>
  ellipsoid(into, centre, [[radius, 0, 0], [0, radius, 0], [0, 0, radius]], colour);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unitOf = (a) => a.map((value) => value / (Math.hypot(...a) || 1));

async function surface(into) {
  const { camera } = info;
  if (!info.surface || !camera || camera.projection === "orthographic") return;
  const [uri, low, span] = info.surface, image = new Image();
  image.src = uri;
  images.set("surface", image);
  const data = await decode("surface"), step = Math.max(1, Math.round(Math.sqrt(info.width * info.height / 60000)));
  const point = (x, y) => {
    const at = 4 * (y * info.width + x);
    if (x >= info.width || y >= info.height || !data[at + 2]) return null;
    const z = low + (data[at] * 256 + data[at + 1]) / 65535 * span, [u, v] = pixelOf(x, y);
    return [(u - camera.cx) / camera.fx * -z, -(v - camera.cy) / camera.fy * -z, z];
  };
  for (let y = 0; y < info.height; y += step) for (let x = 0; x < info.width; x += step) {
    const a = point(x, y), b = point(x, y + step), c = point(x + step, y), d = point(x + step, y + step);
    for (const [p, q, r] of [[a, b, c], [c, b, d]]) {
      // Across an edge of the object nothing is seen: no triangle.
      if (!p || !q || !r || Math.max(p[2], q[2], r[2]) - Math.min(p[2], q[2], r[2]) > span / 8) continue;
      const normal = unitOf(cross(q.map((value, i) => value - p[i]), r.map((value, i) => value - p[i])));
      for (const corner of [p, q, r]) into.push(...corner, ...normal, 0.8, 0.78, 0.74);
    }
  }
}

async function startScene(canvas) {
  canvas.width = canvas.clientWidth * devicePixelRatio;
  canvas.height = canvas.clientHeight * devicePixelRatio;
  const gl = canvas.getContext("webgl");
  if (!gl) {
    canvas.replaceWith("The scene in 3-D needs WebGL, which this browser does not give. The lights are drawn under Lights.");
    return;
  }
  const { lights, spheres } = info, corners = [], middle = lights?.reference_point_mm ?? [0, 0, -1000];
  await surface(corners);
  const far = Math.hypot(...middle), places = [];
  for (const light of lights?.frames ?? []) {
    const toward = light.direction, place = light.position_mm ?? (toward && middle.map((value, i) => value + far * toward[i]));
    if (!place) continue;
    const distance = Math.hypot(...place.map((value, i) => value - middle[i]));
    const side = unitOf(cross(toward, [0.3, 0.9, 0.1])), other = cross(toward, side), small = far / 70;
    const wide = Math.max(small, ENLARGED * distance * (light.direction_sigma_deg ?? 0) * Math.PI / 180);
    ellipsoid(corners, place, [side.map((v) => v * wide), other.map((v) => v * wide), toward.map((v) => v * small)], [0.9, 0.62, 0]);
    places.push(place);
  }
  for (const row of spheres ?? []) if (row.center_mm) {
    const radius = row.diameter_mm ? row.diameter_mm / 2 : row.radius_px * Math.hypot(...row.center_mm) / (info.camera?.fx ?? 1000);
    ball(corners, row.center_mm, radius, [0.55, 0.57, 0.6]);
  }
  ball(corners, [0, 0, 0], far / 40, [0, 0.45, 0.7]);
  const made = gl.createProgram(), stride = 36;
  for (const [type, source] of [[gl.VERTEX_SHADER, SCENE_VERTEX], [gl.FRAGMENT_SHADER, SCENE_FRAGMENT]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  gl.useProgram(made);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(corners), gl.STATIC_DRAW);
  ["place", "normal", "colour"].forEach((name, i) => {
    const at = gl.getAttribLocation(made, name);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, 3, gl.FLOAT, false, stride, 12 * i);
  });
  gl.enable(gl.DEPTH_TEST);
  const reach = Math.max(far, ...places.map((place) => Math.hypot(...place.map((value, i) => value - middle[i]))));
  const turn = { yaw: 0.5, pitch: 0.35, size: 1.7 };
  const draw = () => {
    const [cy, sy, cp, sp] = [Math.cos(turn.yaw), Math.sin(turn.yaw), Math.cos(turn.pitch), Math.sin(turn.pitch)];
    // Parallel projection: turned about the object's centre.
    const rows = [[cy, 0, sy], [sy * sp, cp, -cy * sp], [-sy * cp, sp, cy * cp]], s = turn.size / reach, wide = canvas.height / canvas.width;
    const scale = [s * Math.min(1, wide), s * Math.min(1, 1 / wide), -s / 4], view = [];
    for (let column = 0; column < 3; column++) view.push(...rows.map((row, i) => row[column] * scale[i]), 0);
    view.push(...rows.map((row, i) => -dot(row, middle) * scale[i]), 1);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.15, 0.16, 0.18, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(gl.getUniformLocation(made, "view"), false, view);
    gl.drawArrays(gl.TRIANGLES, 0, corners.length / 9);
  };
  const by = (yaw, pitch, size) => {
    Object.assign(turn, { yaw: turn.yaw + yaw, pitch: Math.max(-1.5, Math.min(1.5, turn.pitch + pitch)), size: turn.size * size });
    draw();
  };
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => { if (event.buttons) by(event.movementX / 150, event.movementY / 150, 1); });
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); by(0, 0, 1.0015 ** -event.deltaY); }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const way = { ArrowLeft: [-0.1, 0, 1], ArrowRight: [0.1, 0, 1], ArrowUp: [0, -0.1, 1], ArrowDown: [0, 0.1, 1], "+": [0, 0, 1.2], "-": [0, 0, 0.8] }[event.key];
    if (way) { event.preventDefault(); by(...way); }
  });
  canvas.dataset.triangles = corners.length / 27;
  draw();
}
