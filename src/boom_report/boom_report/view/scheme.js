"use strict";
// Colours the hydraulic scheme by pressure and moves its dashes with the flow.
(function () {
  const HIGH = 250e5, LPM = 6e4, BAR = 1e-5;
  // From pale blue over sand to dark red: lightness falls with the pressure, so that it survives without colour.
  const STOPS = [[205, 225, 242], [150, 196, 226], [253, 205, 140], [240, 120, 80], [165, 15, 25]];
  function colour(pressure) {
    if (pressure === null) return "var(--unknown)";
    const x = 4 * Math.max(0, Math.min(1, pressure / HIGH)), k = Math.min(3, Math.floor(x));
    return `rgb(${STOPS[k].map((v, i) => Math.round(v + (x - k) * (STOPS[k + 1][i] - v))).join(" ")})`;
  }

  window.makeScheme = function (root) {
    const find = (name) => Array.from(root.querySelectorAll(`[data-${name}]`)), last = new Map(), offset = { head: 0, rod: 0 };
    const coloured = find("pressure"), flows = find("flow"), values = find("value"), spool = root.querySelector("[data-spool]");
    function put(element, key, value) {  // the page is touched only where something has changed
      const id = key + "|" + Array.prototype.indexOf.call(all, element);
      if (last.get(id) === value) return;
      last.set(id, value);
      if (key === "text") element.textContent = value;
      else if (key === "transform") element.setAttribute("transform", value);
      else element.style[key] = value;
    }
    const all = [...coloured, ...flows, ...values, spool];
    const text = (name, said) => values.filter((e) => e.dataset.value === name).forEach((e) => put(e, "text", said));
    const bar = (p) => (p === null ? "" : `${(p * BAR).toFixed(0)} bar`), lpm = (q) => (q === null ? "" : `${(q * LPM).toFixed(0)} l/min`);

    // pressures: hose, rod, head, supply, tank [Pa or null]; flow of head and rod side [m^3/s, into the cylinder]; currents [A].
    return function (pressures, flow, currents, elapsed) {
      coloured.forEach((e) => put(e, e.tagName === "path" ? "stroke" : "fill", colour(pressures[e.dataset.pressure] ?? null)));
      flows.forEach((e) => {
        const q = flow[e.dataset.flow], moving = q !== null && Math.abs(q) * LPM > 0.5;
        put(e, "visibility", moving ? "visible" : "hidden");
        if (moving) {
          offset[e.dataset.flow] = (offset[e.dataset.flow] - Math.max(-300, Math.min(300, q * LPM * 2.5)) * elapsed) % 1000;
          e.style.strokeDashoffset = offset[e.dataset.flow].toFixed(1);
        }
      });
      text("hose", bar(pressures.hose));
      text("rod", bar(pressures.rod));
      text("head-flow", lpm(flow.head));
      text("rod-flow", lpm(flow.rod));
      const way = (currents[0] || 0) - (currents[1] || 0), shift = Math.abs(way) < 0.1 ? 0 : way > 0 ? -1 : 1;
      if (spool) put(spool, "transform", `translate(${shift * Math.min(16, Math.abs(way) * 40).toFixed(0)} 0)`);
    };
  };
})();
