"use strict";
// Turns back what boom_report.packing has packed.
(function () {
  const inflatedText = async function (text) {
    const bytes = Uint8Array.from(atob(text.trim()), (c) => c.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).text();
  };
  const numbers = function (packed) {
    const out = new Float64Array(packed.n).fill(NaN);
    if (!packed.d) return out;
    let whole = 0;
    for (let i = 0; i < packed.n; i++) { whole += packed.d[i]; out[i] = packed.low + packed.step * whole; }
    packed.gaps.forEach(([a, b]) => out.fill(NaN, a, b));
    return out;
  };
  // Arrays anywhere in a chart.
  const unstepped = function (spec) {
    if (Array.isArray(spec)) return spec.map(unstepped);
    if (spec === null || typeof spec !== "object") return spec;
    if (spec.steps) return numbers(spec.steps);
    return Object.fromEntries(Object.entries(spec).map(([name, value]) => [name, unstepped(value)]));
  };
  // The libraries of the page, in their order; then what needs them.
  const libraries = async function () {
    for (const place of document.querySelectorAll("script.library")) {
      const script = document.createElement("script");
      script.textContent = await inflatedText(place.textContent);
      document.head.append(script);
    }
  };
  window.packing = { inflatedText, numbers, unstepped, libraries, known: typeof DecompressionStream !== "undefined" };
})();
