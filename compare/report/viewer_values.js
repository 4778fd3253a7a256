// From the still pictures' colours back to values. `info`: what viewer_section.py states of the pictures.
const byId = (id) => document.getElementById(id);
const info = JSON.parse(byId("viewer-data")?.textContent ?? "null");
const images = new Map([...document.querySelectorAll("img[data-kind]")].map((image) =>
  [`${image.dataset.kind}:${image.dataset.side}:${image.dataset.name}`, image]));
const decoded = new Map();
const levelOf = new Map((info?.palette ?? []).slice(0, -1).map(([r, g, b], level) => [(r << 16) | (g << 8) | b, level]));
const known = ([r, g, b]) => !(r === 246 && g === 246 && b === 246);

async function decode(key) {
  const image = images.get(key);
  if (!image) return null;
  if (decoded.has(key)) return decoded.get(key);
  await image.decode();
  const canvas = new OffscreenCanvas(info.width, info.height);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0, info.width, info.height);
  decoded.set(key, context.getImageData(0, 0, info.width, info.height).data);
  return decoded.get(key);
}

const codesAt = (key, x, y) => {
  const data = decoded.get(key), at = 4 * (y * info.width + x);
  return data ? [data[at], data[at + 1], data[at + 2]] : null;
};
const linear = (code) => { const v = code / 255; return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; };
const scaled = (codes, scale) => codes.map((code, c) => linear(code) * scale.white * scale.balance[c]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

function normalAt(side, name, x, y) {
  const codes = codesAt(`normals:${side}:${name}`, x, y);
  if (!codes || !known(codes)) return null;
  const n = codes.map((code) => code / 127.5 - 1), length = Math.hypot(...n);
  return n.map((value) => value / length);
}
function angleAt(kind, side, name, x, y) {
  const codes = codesAt(`${kind}:${side}:${name}`, x, y);
  const level = codes && levelOf.get((codes[0] << 16) | (codes[1] << 8) | codes[2]);
  return level === undefined || level === null ? null : level / 254 * info.scales[kind].end_deg;
}
function albedoAt(name, x, y) {
  const codes = codesAt(`albedo:real:${name}`, x, y);
  return codes && scaled(codes, info.scales[`albedo-${name}`]);
}
// A photograph's value of each channel; `clipped` at the top of the picture's scale.
function sampleAt(side, frame, x, y) {
  const codes = codesAt(`photograph:${side}:${frame}`, x, y);
  return codes && { value: scaled(codes, info.scales[`photograph-${side}`]), clipped: Math.max(...codes) > 253 };
}

const pixelOf = (x, y) => [info.left + x * info.step, info.top + y * info.step];
// A pixel's point on the plane of the lights' reference point, mm; lens distortion is left out.
function pointOf(u, v) {
  const { camera, lights } = info, z = lights.reference_point_mm[2];
  if (!camera || camera.projection === "orthographic") return lights.reference_point_mm;
  return [(u - camera.cx) / camera.fx * -z, -(v - camera.cy) / camera.fy * -z, z];
}
// The light vector at a pixel: unit at the reference point, a near light's length elsewhere is its fall-off.
function toward(light, u, v) {
  if (!light.position_mm) return light.direction;
  const point = pointOf(u, v), away = light.position_mm.map((value, i) => value - point[i]);
  const far = Math.hypot(...light.position_mm.map((value, i) => value - info.lights.reference_point_mm[i]));
  return away.map((value) => value * far ** 2 / Math.hypot(...away) ** 3);
}
