// From the still pictures' colours back to values. `info`: what layers.py states of the pictures.
const byId = (id) => document.getElementById(id);
const info = JSON.parse(byId("viewer-data")?.textContent ?? "null");
const images = new Map([...document.querySelectorAll("img[data-kind]")].map((image) =>
  [`${image.dataset.kind}:${image.dataset.side}:${image.dataset.name}`, image]));
const decoded = new Map();
const levelOf = new Map((info?.palette ?? []).map(([r, g, b], level) => [(r << 16) | (g << 8) | b, level]));
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
  return level === undefined || level === null ? null : level / 255 * (info.scales[`${kind}-${side}`] ?? info.scales[kind]).end_deg;
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
  const [x, y, z] = light.position_mm, p = pointOf(u, v), q = info.lights.reference_point_mm;
  const away = [x - p[0], y - p[1], z - p[2]], far = [x - q[0], y - q[1], z - q[2]];
  const gain = dot(far, far) / dot(away, away) ** 1.5;
  return [away[0] * gain, away[1] * gain, away[2] * gain];
}

// Normals and albedo under a lamp, a light as lights.json has it, on a canvas; null until both are decoded.
const SRGB = Uint8ClampedArray.from({ length: 4096 }, (_, i) =>
  Math.round(255 * (i <= 12 ? 12.92 * i / 4095 : 1.055 * (i / 4095) ** (1 / 2.4) - 0.055)));
const LINEAR = Float32Array.from({ length: 256 }, (_, code) => linear(code));
const relights = new Map();
function relit(name, lamp) {
  if (relights.get(name)?.lamp === lamp) return relights.get(name).canvas;
  const normals = decoded.get(`normals:real:${name}`), albedo = decoded.get(`albedo:real:${name}`);
  if (!normals || !albedo) return null;
  const exposure = info.scales["photograph-real"], scale = info.scales[`albedo-${name}`];
  const gain = lamp.intensity.map((value, c) => 4095 * (exposure
    ? value * scale.white * scale.balance[c] / (exposure.white * exposure.balance[c]) : value));
  const canvas = relights.get(name)?.canvas ?? new OffscreenCanvas(info.width, info.height);
  const picture = new ImageData(normals.slice(), info.width), codes = picture.data;
  for (let at = 0; at < codes.length; at += 4) {
    if (!known([codes[at], codes[at + 1], codes[at + 2]])) continue;
    const n = [codes[at] - 127.5, codes[at + 1] - 127.5, codes[at + 2] - 127.5], x = at / 4 % info.width;
    const light = toward(lamp, info.left + x * info.step, info.top + (at / 4 - x) / info.width * info.step);
    const shade = Math.max(0, dot(n, light)) / Math.sqrt(dot(n, n));
    for (let c = 0; c < 3; c++) codes[at + c] = SRGB[Math.min(4095, Math.round(shade * gain[c] * LINEAR[albedo[at + c]]))];
  }
  canvas.getContext("2d").putImageData(picture, 0, 0);
  relights.set(name, { lamp, canvas });
  return canvas;
}
