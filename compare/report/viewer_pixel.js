// A pixel's samples over the lights, divided by the lights' intensities, and what each method's answer predicts.
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00"];
const element = (tag, values = {}, text = "") => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(values)) made.setAttribute(name, value);
  made.textContent = text;
  return made;
};
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
const methodNames = () => [...images.keys()].filter((key) => key.startsWith("albedo:real:")).map((key) => key.slice(12));

// [{name, sample, clipped, fits: {method: value}}], one a light.
function samplesOf(x, y) {
  const [u, v] = pixelOf(x, y), lights = info.lights?.frames ?? [];
  return info.frames.map((name, k) => {
    const light = lights[k]?.direction ? lights[k] : null, seen = sampleAt("real", k, x, y), fits = {};
    const intensity = light?.intensity ?? [1, 1, 1];
    // A metal's lobes are another law, whose numbers are not on the page.
    if (light) for (const method of methodNames().filter((one) => one !== "metal")) {
      const normal = normalAt("real", method, x, y), albedo = albedoAt(method, x, y);
      if (normal && albedo) fits[method] = mean(albedo) * Math.max(0, dot(normal, toward(light, u, v)));
    }
    return { name, sample: seen && mean(seen.value.map((value, c) => value / intensity[c])), clipped: seen?.clipped, fits };
  });
}

const sampleKeys = () => [...info.frames.map((_, k) => `photograph:real:${k}`),
  ...methodNames().flatMap((method) => [`normals:real:${method}`, `albedo:real:${method}`])];

async function showSamples(place, x, y) {
  const began = performance.now();
  await Promise.all(sampleKeys().map(decode));
  const rows = samplesOf(x, y), [u, v] = pixelOf(x, y), methods = methodNames().filter((name) => rows.some((row) => name in row.fits));
  const top = 1.08 * Math.max(1e-9, ...rows.flatMap((row) => [row.sample ?? 0, ...Object.values(row.fits)]));
  const across = (k) => 52 + (rows.length > 1 ? k / (rows.length - 1) : 0.5) * 632, up = (value) => 218 - value / top * 200;
  const chart = element("svg", { viewBox: "0 0 700 262", role: "img", "aria-label": `samples of pixel ${u}, ${v} over the lights` });
  for (let part = 0; part <= 4; part++) {
    chart.append(element("path", { d: `M48 ${up(part / 4 * top)}H690`, class: "grid" }));
    chart.append(element("text", { x: 44, y: up(part / 4 * top) + 4, "text-anchor": "end" }, (part / 4 * top).toPrecision(2)));
  }
  const each = Math.ceil(rows.length / 16);
  rows.forEach((row, k) => { if (k % each === 0) chart.append(element("text", { x: across(k), y: 236, "text-anchor": "middle" }, k + 1)); });
  chart.append(element("text", { x: 368, y: 256, "text-anchor": "middle" }, "light"));
  const title = document.createElement("p");
  title.append(`Pixel column ${u}, row ${v}: samples (dots; hollow: at the top of the picture's scale)`,
    methods.length ? " and albedo max(0, n · l) of " : "");
  methods.forEach((method, m) => {
    const name = Object.assign(document.createElement("b"), { textContent: `${m ? ", " : ""}${["—", "– –", "···"][m % 3]} ${method}` });
    name.style.borderBottom = `3px solid ${COLOURS[m % COLOURS.length]}`;
    title.append(name);
    const d = rows.map((row, k) => (method in row.fits ? `${across(k).toFixed(1)} ${up(row.fits[method]).toFixed(1)}` : null)).filter(Boolean).join("L");
    chart.append(element("path", { d: `M${d}`, fill: "none", stroke: COLOURS[m % COLOURS.length], "stroke-width": 2, "stroke-dasharray": ["", "6 3", "2 3"][m % 3] }));
  });
  rows.forEach((row, k) => {
    if (row.sample === null) return;
    const dotted = element("circle", { cx: across(k), cy: up(row.sample), r: 4.5, class: row.clipped ? "clipped" : "sample" });
    dotted.append(element("title", {}, `${row.name}: ${row.sample.toPrecision(4)}${row.clipped ? " or more" : ""}`));
    chart.append(dotted);
  });
  place.replaceChildren(title, chart);
  Object.assign(place.dataset, { pixel: `${u},${v}`, values: JSON.stringify(rows), ms: (performance.now() - began).toFixed(1) });
}
