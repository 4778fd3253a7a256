// What the studio adds to viser's page: what the server says of the view stands in one element of the panel.
"use strict";

setInterval(() => {
  const state = document.getElementById("studio-state")?.dataset;
  const controls = window.__viserMutable?.cameraControl;
  if (!state) return;
  // Before a photograph the left hand button moves it and the wheel enlarges what is under the pointer; what stands in
  // space is turned. 1 and 2 are ROTATE and TRUCK of the library camera-controls.
  const isFlat = state.flat === "true";
  if (controls) {
    controls.mouseButtons.left = isFlat ? 2 : 1;
    controls.touches.one = isFlat ? 64 : 32;
    controls.dollyToCursor = isFlat;
    document.documentElement.dataset.flat = state.flat;
  }
  // The report lies over the view, as large as it.
  const view = document.querySelector("canvas")?.getBoundingClientRect();
  let frame = document.getElementById("studio-report");
  if (!state.report || !view) return frame?.remove();
  if (!frame) {
    frame = Object.assign(document.createElement("iframe"), { id: "studio-report", title: "Report" });
    frame.setAttribute("sandbox", "allow-scripts allow-popups allow-downloads allow-modals");
    document.body.append(frame);
  }
  if (frame.getAttribute("src") !== state.report) frame.src = state.report;
  for (const side of ["left", "top", "width", "height"]) frame.style[side] = `${view[side]}px`;
}, 100);
