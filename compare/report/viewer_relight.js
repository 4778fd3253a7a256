// Normals and albedo under a lamp. `relit` returns a canvas of the grid's size, or null where nothing can be drawn.
const VERTEX = "attribute vec2 place; varying vec2 uv; void main() { uv = (place + 1.0) / 2.0; gl_Position = vec4(place, 0, 1); }";
const FRAGMENT = `precision highp float;
varying vec2 uv; uniform sampler2D normals, albedo;
uniform vec3 lamp, reference, gain; uniform vec4 camera; uniform vec4 box; uniform float far;
vec3 linear(vec3 v) { return mix(v / 12.92, pow((v + 0.055) / 1.055, vec3(2.4)), step(0.04045, v)); }
void main() {
  vec3 code = texture2D(normals, uv).rgb, n = normalize(code * 255.0 / 127.5 - 1.0), l = lamp;
  if (distance(code, vec3(246.0 / 255.0)) < 0.001) { gl_FragColor = vec4(code, 1); return; }
  if (far > 0.0) {
    vec2 pixel = floor(vec2(uv.x, 1.0 - uv.y) * box.zw) * camera.w + box.xy;
    vec3 point = camera.x > 0.0 ? vec3(-reference.z * pixel.x / camera.x, reference.z * pixel.y / camera.y, reference.z) : reference;
    vec3 away = lamp - point; float d = length(away); l = away * (far / d) * (far / d) / d;
  }
  vec3 v = clamp(max(dot(n, l), 0.0) * linear(texture2D(albedo, uv).rgb) * gain, 0.0, 1.0);
  gl_FragColor = vec4(mix(12.92 * v, 1.055 * pow(v, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, v)), 1);
}`;

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  gl.useProgram(made);
  return made;
}

const relighting = new Map();
function relighter(name) {
  if (relighting.has(name)) return relighting.get(name);
  const canvas = Object.assign(document.createElement("canvas"), { width: info.width, height: info.height });
  const gl = canvas.getContext("webgl", { preserveDrawingBuffer: true, antialias: false });
  const parts = [`normals:real:${name}`, `albedo:real:${name}`].map((key) => images.get(key));
  if (!gl || parts.some((image) => !image?.complete)) return null;
  const made = program(gl, VERTEX, FRAGMENT);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
  gl.enableVertexAttribArray(gl.getAttribLocation(made, "place"));
  gl.vertexAttribPointer(gl.getAttribLocation(made, "place"), 2, gl.FLOAT, false, 0, 0);
  gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, true);
  gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
  parts.forEach((image, unit) => {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
    for (const wrap of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, wrap, gl.CLAMP_TO_EDGE);
    gl.uniform1i(gl.getUniformLocation(made, unit ? "albedo" : "normals"), unit);
  });
  relighting.set(name, { gl, made, canvas });
  return relighting.get(name);
}

// `lamp`: a light as lights.json has it: direction, position_mm or null, intensity.
function relit(name, lamp) {
  const view = relighter(name);
  if (!view) return null;
  const { gl, made, canvas } = view, { camera, lights } = info;
  const exposure = info.scales["photograph-real"], albedo = info.scales[`albedo-${name}`];
  const set = (kind, uniform, ...values) => gl[`uniform${kind}`](gl.getUniformLocation(made, uniform), ...values);
  const near = lamp.position_mm, reference = lights?.reference_point_mm ?? [0, 0, -1];
  set("3f", "lamp", ...(near ?? lamp.direction));
  set("3f", "reference", ...reference);
  set("1f", "far", near ? Math.hypot(...near.map((value, i) => value - reference[i])) : 0);
  const perspective = camera && camera.projection !== "orthographic";
  set("4f", "camera", perspective ? camera.fx : 0, perspective ? camera.fy : 0, 0, info.step);
  set("4f", "box", info.left - (camera?.cx ?? 0), info.top - (camera?.cy ?? 0), info.width, info.height);
  set("3f", "gain", ...lamp.intensity.map((value, c) => exposure
    ? value * albedo.white * albedo.balance[c] / (exposure.white * exposure.balance[c]) : value));
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  return canvas;
}
