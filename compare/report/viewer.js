// The instrument: two pictures wiped over each other, a pointer that reads values, a lamp.
function startViewer() {
  const canvas = byId("viewer-canvas"), context = canvas.getContext("2d"), wipe = byId("viewer-wipe");
  const sides = ["left", "right"].map((side) => byId(`viewer-${side}`)), values = byId("viewer-values");
  const frame = byId("viewer-frame"), azimuth = byId("viewer-azimuth"), zenith = byId("viewer-zenith"), dome = byId("viewer-dome");
  const view = { scale: 1, x: 0, y: 0 }, touches = new Map();
  let pointer = null, lamp = null, moved = 0, wiping = false;
  byId("instrument").hidden = false;
  byId("viewer-still").hidden = true;
  frame.value = info.frame;
  if (info.frames.length < 2) frame.disabled = true;

  const sourceOf = (key) => {
    const [kind, side, name] = key.split(":");
    if (kind === "photograph") return images.get(`${kind}:${side}:${frame.value}`);
    return kind === "relit" ? relit(name, lamp) ?? images.get(`albedo:real:${name}`) : images.get(key);
  };
  const fitting = () => {
    view.scale = Math.min(canvas.width / info.width, canvas.height / info.height);
    view.x = (canvas.width - info.width * view.scale) / 2;
    view.y = (canvas.height - info.height * view.scale) / 2;
  };
  const draw = () => {
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = "#8b8f94";
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.imageSmoothingEnabled = view.scale < 1.5;
    const edge = Number(wipe.value) * canvas.width;
    [[0, edge], [edge, canvas.width]].forEach(([from, to], i) => {
      const image = sourceOf(sides[i].value);
      if (!image || to <= from) return;
      context.save();
      context.beginPath();
      context.rect(from, 0, to - from, canvas.height);
      context.clip();
      context.drawImage(image, view.x, view.y, info.width * view.scale, info.height * view.scale);
      context.restore();
    });
    context.fillStyle = "#fff";
    context.fillRect(edge - 1, 0, 2, canvas.height);
    context.fillRect(edge - 4, canvas.height / 2 - 18, 8, 36);
    if (pointer) {
      context.strokeStyle = "#fff";
      const side = Math.max(view.scale, 6), at = [pointer[0] + 0.5, pointer[1] + 0.5];
      context.strokeRect(view.x + at[0] * view.scale - side / 2, view.y + at[1] * view.scale - side / 2, side, side);
    }
    byId("viewer-frame-name").textContent = info.frames[frame.value] ? `${Number(frame.value) + 1}, ${info.frames[frame.value]}` : "";
    byId("viewer-lamp").hidden = !sides.some((side) => side.value.startsWith("relit"));
  };
  const redraw = () => requestAnimationFrame(draw);
  const size = () => {
    const box = canvas.getBoundingClientRect(), ratio = devicePixelRatio || 1;
    canvas.width = Math.round(box.width * ratio);
    canvas.height = Math.round(box.height * ratio);
    fitting();
    draw();
  };
  const placeOf = (event) => {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left) * canvas.width / box.width, (event.clientY - box.top) * canvas.height / box.height];
  };
  const gridOf = ([px, py]) => {
    const x = Math.floor((px - view.x) / view.scale), y = Math.floor((py - view.y) / view.scale);
    return x >= 0 && y >= 0 && x < info.width && y < info.height ? [x, y] : null;
  };

  // Each side's method's values; of photographs the best method's.
  const sourcesShown = () => [...new Set(sides.map((side) => {
    const [kind, of, name] = side.value.split(":");
    return kind === "photograph" ? `${of}:${info.best}` : `${of}:${name}`;
  }))];
  const readout = () => {
    if (!pointer) return;
    const began = performance.now(), [x, y] = pointer, [u, v] = pixelOf(x, y), lines = [`column ${u}, row ${v}`];
    const parts = (found) => found?.map((part) => part.toFixed(3)).join(", "), angle = (found) => found === null ? "" : `${found.toFixed(2)}°`;
    const sample = sampleAt("real", frame.value, x, y);
    if (sample) lines.push(`photograph ${parts(sample.value)}`);
    const told = sourcesShown().map((source) => {
      const [side, name] = source.split(":"), normal = normalAt(side, name, x, y), albedo = albedoAt(name, x, y);
      const error = angleAt("error", side, name, x, y), sigma = angleAt("sigma", side, name, x, y);
      lines.push(`${name === "truth" ? "ground truth" : name}${side === "twin" ? ", twin" : ""}:`);
      const rows = { normal: parts(normal), error: angle(error), sigma: angle(sigma), albedo: parts(albedo) };
      for (const [word, value] of Object.entries(rows)) if (value) lines.push(`  ${word} ${value}`);
      return { side, name, normal, error, sigma, albedo };
    });
    values.textContent = lines.join("\n");
    Object.assign(values.dataset, { pixel: `${u},${v}`, values: JSON.stringify(told), ms: (performance.now() - began).toFixed(2) });
  };
  const load = async () => {
    const keys = sourcesShown().flatMap((source) => [
      `normals:${source}`, `error:${source}`, `sigma:${source}`, `albedo:real:${source.split(":")[1]}`]);
    await Promise.all([`photograph:real:${frame.value}`, ...sides.map((side) => side.value), ...keys].map(decode));
    readout();
    draw();
  };
  const zoom = (factor, [px, py]) => {
    const least = Math.min(canvas.width / info.width, canvas.height / info.height) / 2;
    const scale = Math.min(64, Math.max(least, view.scale * factor)), by = scale / view.scale;
    Object.assign(view, { scale, x: px - (px - view.x) * by, y: py - (py - view.y) * by });
    redraw();
  };
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(1.0015 ** -event.deltaY, placeOf(event));
  }, { passive: false });
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    touches.set(event.pointerId, placeOf(event));
    moved = 0;
    wiping = touches.size === 1 && Math.abs(placeOf(event)[0] - wipe.value * canvas.width) < 12 * (devicePixelRatio || 1);
  });
  canvas.addEventListener("pointermove", (event) => {
    const place = placeOf(event), before = touches.get(event.pointerId);
    if (before) {
      moved += Math.hypot(place[0] - before[0], place[1] - before[1]);
      const other = [...touches].find(([id]) => id !== event.pointerId)?.[1];
      if (other) {
        zoom(Math.hypot(place[0] - other[0], place[1] - other[1]) / Math.hypot(before[0] - other[0], before[1] - other[1]), other);
      } else if (wiping) {
        wipe.value = place[0] / canvas.width;
      } else if (moved > 4) {
        view.x += place[0] - before[0];
        view.y += place[1] - before[1];
      }
      touches.set(event.pointerId, place);
      redraw();
    }
    pointer = gridOf(place);
    readout();
  });
  for (const kind of ["pointerup", "pointercancel"]) canvas.addEventListener(kind, (event) => {
    const isClick = kind === "pointerup" && touches.size === 1 && moved <= 4;
    if (isClick && (pointer = gridOf(placeOf(event)))) showSamples(byId("viewer-samples"), ...pointer);
    touches.delete(event.pointerId);
    redraw();
  });
  canvas.addEventListener("keydown", (event) => {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (way) {
      const by = event.shiftKey ? 10 : 1, from = pointer ?? [info.width >> 1, info.height >> 1];
      pointer = [Math.min(info.width - 1, Math.max(0, from[0] + by * way[0])), Math.min(info.height - 1, Math.max(0, from[1] + by * way[1]))];
      readout();
    } else if (event.key === "Enter" && pointer) showSamples(byId("viewer-samples"), ...pointer);
    else if (event.key === "+" || event.key === "-") zoom(event.key === "+" ? 1.25 : 0.8, [canvas.width / 2, canvas.height / 2]);
    else return;
    event.preventDefault();
    redraw();
  });
  byId("viewer-fit").addEventListener("click", () => { fitting(); draw(); });
  wipe.addEventListener("input", redraw);
  for (const control of [...sides, frame]) control.addEventListener("input", load);

  // The lamp stands as far away as the lights do, in the median.
  const reference = info.lights?.reference_point_mm, placed = (info.lights?.frames ?? []).filter((light) => light.position_mm);
  const far = placed.map((light) => Math.hypot(...minus(light.position_mm, reference))).sort((a, b) => a - b)[placed.length >> 1];
  const setLamp = (direction, light) => {
    lamp = light ?? { direction, intensity: [1, 1, 1], position_mm: far && direction.map((part, i) => reference[i] + far * part) };
    if (Math.hypot(direction[0], direction[1])) azimuth.value = (Math.atan2(direction[1], direction[0]) * 180 / Math.PI + 360) % 360;
    zenith.value = Math.acos(direction[2]) * 180 / Math.PI;
    dome.style.setProperty("--x", direction[0]);
    dome.style.setProperty("--y", direction[1]);
    redraw();
  };
  const slide = () => {
    const a = azimuth.value * Math.PI / 180, z = zenith.value * Math.PI / 180;
    setLamp([Math.sin(z) * Math.cos(a), Math.sin(z) * Math.sin(a), Math.cos(z)]);
  };
  const drag = (event) => {
    if (!event.buttons) return;
    const box = dome.getBoundingClientRect(), x = (event.clientX - box.left) / box.width * 2 - 1, y = 1 - (event.clientY - box.top) / box.height * 2;
    // To 85 degrees from the axis at most, as the slider.
    const long = Math.max(0.92, 1.004 * Math.hypot(x, y)), [i, j] = [x / long, y / long];
    setLamp([i, j, Math.sqrt(1 - i * i - j * j)]);
  };
  for (const kind of ["pointerdown", "pointermove"]) dome.addEventListener(kind, drag);
  dome.addEventListener("pointerdown", (event) => dome.setPointerCapture(event.pointerId));
  for (const slider of [azimuth, zenith]) slider.addEventListener("input", slide);
  byId("viewer-as-light").addEventListener("click", () => {
    const light = info.lights?.frames?.[frame.value];
    if (light?.direction) setLamp(light.direction, light);
  });
  byId("viewer-3d").addEventListener("toggle", () => startScene(byId("viewer-scene")), { once: true });
  slide();
  new ResizeObserver(size).observe(canvas);
  // What a click needs is decoded before the first one, while nothing else is to be done.
  load().then(() => (window.requestIdleCallback ?? setTimeout)(async () => {
    for (const key of sampleKeys()) await decode(key);
  }));
}
if (info && byId("instrument")) startViewer();
