// The scene in 3-D, camera frame (x right, y up, z toward the viewer), mm: points as near as pixels, the nearest seen.
const ENLARGED = 10, AROUND = 40;
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unitOf = (a) => a.map((value) => value / (Math.hypot(...a) || 1));
const minus = (a, b) => a.map((value, i) => value - b[i]);

// Five numbers a point: its place, how far its neighbours are, and its colour as the canvas has it, lit from the camera.
function addPoint(points, place, normal, spacing, colour) {
  const [r, g, b] = colour.map((part) => 255 * part * (0.35 + 0.65 * Math.max(0, normal[2])));
  points.push(...place, spacing, ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0);
}

// An ellipsoid: half-axes (three vectors) about a centre.
function addEllipsoid(points, centre, axes, colour) {
  const spacing = Math.PI / AROUND * Math.max(...axes.map((axis) => Math.hypot(...axis)));
  for (let i = 0; i <= AROUND; i++) for (let j = 0; j < 2 * AROUND; j++) {
    const a = i / AROUND * Math.PI, b = j / AROUND * Math.PI;
    const unit = [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)];
    addPoint(points, centre.map((c, k) => c + dot(unit, axes.map((axis) => axis[k]))), unit, spacing, colour);
  }
}
const addBall = (points, centre, radius, colour) =>
  addEllipsoid(points, centre, [[radius, 0, 0], [0, radius, 0], [0, 0, radius]], colour);

function addSurface(points) {
  const { camera, surface } = info;
  if (!surface || !camera || camera.projection === "orthographic") return;
  const { low, span, width, step } = surface, codes = new Uint16Array(Uint8Array.from(atob(surface.codes), (byte) => byte.charCodeAt(0)).buffer);
  const point = (x, y) => {
    const code = x < width && codes[y * width + x], z = low + (code - 1) / 65534 * span;
    return code ? [(info.left + x * step - camera.cx) / camera.fx * -z, -(info.top + y * step - camera.cy) / camera.fy * -z, z] : null;
  };
  for (let y = 0; y < codes.length / width; y++) for (let x = 0; x < width; x++) {
    const here = point(x, y), down = point(x, y + 1), right = point(x + 1, y);
    // Across an edge of the object nothing is known of the normal.
    if (!here || !down || !right || Math.max(Math.abs(down[2] - here[2]), Math.abs(right[2] - here[2])) > span / 8) continue;
    const ways = [minus(down, here), minus(right, here)], normal = unitOf(cross(...ways)), flat = step * -here[2] / camera.fx;
    // Down a steep place more points, not larger ones.
    const [far, way] = ways.map((each) => [Math.hypot(...each), each]).sort((a, b) => b[0] - a[0])[0], count = Math.max(1, Math.round(far / flat));
    for (let k = 0; k < count; k++) addPoint(points, here.map((value, i) => value + way[i] * k / count), normal, far / count, [0.8, 0.78, 0.74]);
  }
}

function startScene(canvas) {
  canvas.width = canvas.clientWidth * devicePixelRatio;
  canvas.height = canvas.clientHeight * devicePixelRatio;
  const { lights, spheres } = info, points = [], middle = lights?.reference_point_mm ?? [0, 0, -1000];
  addSurface(points);
  const far = Math.hypot(...middle);
  let reach = far;
  for (const light of lights?.frames ?? []) {
    const toward = light.direction, place = light.position_mm ?? (toward && middle.map((value, i) => value + far * toward[i]));
    if (!place) continue;
    const distance = Math.hypot(...minus(place, middle));
    const side = unitOf(cross(toward, [0.3, 0.9, 0.1])), other = cross(toward, side), small = far / 70;
    const wide = Math.max(small, ENLARGED * distance * (light.direction_sigma_deg ?? 0) * Math.PI / 180);
    addEllipsoid(points, place, [side.map((v) => v * wide), other.map((v) => v * wide), toward.map((v) => v * small)], [0.9, 0.62, 0]);
    reach = Math.max(reach, distance);
  }
  for (const row of spheres ?? []) if (row.center_mm) {
    const radius = row.diameter_mm ? row.diameter_mm / 2 : row.radius_px * Math.hypot(...row.center_mm) / (info.camera?.fx ?? 1000);
    addBall(points, row.center_mm, radius, [0.55, 0.57, 0.6]);
  }
  addBall(points, [0, 0, 0], far / 40, [0, 0.45, 0.7]);
  const { width, height } = canvas, context = canvas.getContext("2d"), turn = { yaw: 0.5, pitch: 0.35, size: 1.7 };
  const picture = new ImageData(width, height), pixels = new Uint32Array(picture.data.buffer), nearest = new Float32Array(width * height);
  const draw = () => {
    const [cy, sy, cp, sp] = [Math.cos(turn.yaw), Math.sin(turn.yaw), Math.cos(turn.pitch), Math.sin(turn.pitch)];
    // Parallel projection: turned about the object's centre.
    const rows = [[cy, 0, sy], [sy * sp, cp, -cy * sp], [-sy * cp, sp, cy * cp]], scale = turn.size / reach * Math.min(width, height) / 2;
    pixels.fill(0xff2e2926);
    nearest.fill(-Infinity);
    for (let k = 0; k < points.length; k += 5) {
      const from = [points[k] - middle[0], points[k + 1] - middle[1], points[k + 2] - middle[2]], half = Math.max(0.5, 0.75 * scale * points[k + 3]);
      const x = width / 2 + scale * dot(rows[0], from), y = height / 2 - scale * dot(rows[1], from), z = dot(rows[2], from);
      for (let v = Math.max(0, Math.ceil(y - half)); v < Math.min(height, y + half); v++) {
        for (let u = Math.max(0, Math.ceil(x - half)); u < Math.min(width, x + half); u++) {
          const at = v * width + u;
          if (z > nearest[at]) [nearest[at], pixels[at]] = [z, points[k + 4]];
        }
      }
    }
    context.putImageData(picture, 0, 0);
  };
  const by = (yaw, pitch, size) => {
    Object.assign(turn, { yaw: turn.yaw + yaw, pitch: Math.max(-1.5, Math.min(1.5, turn.pitch + pitch)), size: turn.size * size });
    requestAnimationFrame(draw);
  };
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => { if (event.buttons) by(event.movementX / 150, event.movementY / 150, 1); });
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); by(0, 0, 1.0015 ** -event.deltaY); }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const way = { ArrowLeft: [-0.1, 0, 1], ArrowRight: [0.1, 0, 1], ArrowUp: [0, -0.1, 1], ArrowDown: [0, 0.1, 1], "+": [0, 0, 1.2], "-": [0, 0, 0.8] }[event.key];
    if (way) { event.preventDefault(); by(...way); }
  });
  canvas.dataset.points = points.length / 5;
  draw();
}
