// What the studio adds to viser's page. Everything goes to the server through viser's own buttons.
"use strict";

// Tabs and links press hidden buttons of viser's.
document.addEventListener("click", (event) => {
  const from = event.target.closest?.("[data-press]");
  if (from) document.getElementById(from.dataset.press)?.click();
});

// Undo and redo by keys, except where a text is typed: an input has its own.
document.addEventListener("keydown", (event) => {
  if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z") return;
  if (event.target.matches?.("input, textarea")) return;
  event.preventDefault();
  document.querySelector(`[data-key="${event.shiftKey ? "redo" : "undo"}"]`)?.click();
});

// Before a photograph the left hand button moves it and the wheel enlarges what is under the pointer; what stands in
// space is turned. 1 and 2 are ROTATE and TRUCK of the library camera-controls.
function steer(isFlat) {
  const controls = window.__viserMutable?.cameraControl;
  if (!controls) return;
  controls.mouseButtons.left = isFlat ? 2 : 1;
  controls.touches.one = isFlat ? 64 : 32;
  controls.dollyToCursor = isFlat;
  document.documentElement.dataset.flat = isFlat;
}

// The report lies over the view, as large as it.
function showReport(address) {
  let frame = document.getElementById("studio-report");
  const view = document.querySelector("canvas")?.getBoundingClientRect();
  if (!address || !view) return frame?.remove();
  if (!frame) {
    frame = Object.assign(document.createElement("iframe"), { id: "studio-report", title: "Report" });
    frame.setAttribute("sandbox", "allow-scripts allow-popups allow-downloads allow-modals");
    document.body.append(frame);
  }
  if (frame.getAttribute("src") !== address) frame.src = address;
  for (const side of ["left", "top", "width", "height"]) frame.style[side] = `${view[side]}px`;
}

// A page that stayed open while the studio was ended and started again says so: what was not kept is gone.
function tellRestart(run) {
  const before = sessionStorage.getItem("studio-run");
  sessionStorage.setItem("studio-run", run);
  if (!before || before === run) return;
  const told = Object.assign(document.createElement("div"), { id: "studio-told" });
  told.setAttribute("role", "alert");
  told.textContent = "The studio was started again. What was saved or kept is here; what was not is gone.";
  told.addEventListener("click", () => told.remove());
  document.body.append(told);
}

// What the server says of the page stands in one element.
setInterval(() => {
  const state = document.getElementById("studio-state");
  if (!state) return;
  steer(state.dataset.flat === "true");
  showReport(state.dataset.report);
  if (state.dataset.run !== document.body.dataset.run) tellRestart(document.body.dataset.run = state.dataset.run);
}, 100);
