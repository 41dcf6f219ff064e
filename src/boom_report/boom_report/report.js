"use strict";
(async function () {
  if (!packing.known) {
    document.querySelector("main").insertAdjacentHTML("afterbegin",
      "<p class=alert>This browser is too old for the charts, which need one of 2023 or later; the tables are complete without them.</p>");
    return;
  }
  await packing.libraries();
  const figures = Array.from(document.querySelectorAll(".figure"));
  const touch = window.matchMedia("(pointer: coarse)").matches;
  // Without showSendToCloud the chart would offer to send the recording to its maker's server.
  const config = {
    displaylogo: false, responsive: true, showSendToCloud: false, plotlyServerURL: "", modeBarButtonsToRemove: ["select2d", "lasso2d"],
  };

  const specs = new Map();
  for (const figure of figures) specs.set(figure, await packing.inflatedText(figure.nextElementSibling.textContent));
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  let printing = false;

  // What a chart is made of, on a light ground or with the dark counterpart of each colour.
  function specOf(figure, onDark) {
    const text = specs.get(figure);
    const spec = packing.unstepped(JSON.parse(onDark ? text.replace(/#[0-9a-f]{6}|rgba\([^)]*\)/g, (colour) => darkColours[colour] || colour) : text));
    // A finger scrolls the page; a mouse zooms into the chart.
    spec.layout.dragmode = touch ? false : "zoom";
    const narrow = figure.clientWidth < 560;
    if (!narrow && spec.layout.legend) {
      // Room for the tool bar above the legend.
      spec.layout.margin.t += 28;
      spec.layout.height += 28;
    }
    if (narrow) {
      spec.layout.font.size = 11;
      spec.layout.margin.l = 40;
      spec.layout.margin.r = 6;
      // The legend wraps to two entries a row.
      const entries = spec.data.filter((trace) => trace.type === "scatter" && trace.showlegend !== false).length;
      const grow = spec.layout.legend && entries > 2 ? Math.max(30, 40 + 20 * Math.ceil(entries / 2) - spec.layout.margin.t) : 0;
      spec.layout.margin.t += grow;
      spec.layout.height += grow;
      spec.layout.annotations.filter((note) => note.name === "error").forEach((note) => { note.text = note.text.split(" (")[0]; });
      Object.keys(spec.layout).filter((key) => key.startsWith("xaxis")).forEach((key) => { spec.layout[key].nticks = 6; });
    }
    return spec;
  }

  function draw(figure) {
    if (figure.dataset.drawn) return;
    figure.dataset.drawn = "yes";
    const spec = specOf(figure, dark.matches);
    // Not kept in figure.layout: a window that changes its size takes it away there.
    figure.dataset.height = spec.layout.height;
    figure.dataset.legend = spec.layout.legend ? spec.layout.legend.y : "";
    figure.style.minHeight = "";
    Plotly.newPlot(figure, spec.data, spec.layout, Object.assign({ displayModeBar: figure.clientWidth < 560 ? false : "hover" }, config));
  }

  // On another ground; what was zoomed or clicked away is shown again.
  function recolour(onDark) {
    figures.filter((figure) => figure.dataset.drawn).forEach(function (figure) {
      const spec = specOf(figure, onDark);
      Plotly.react(figure, spec.data, spec.layout);
    });
  }
  dark.addEventListener("change", () => { if (!printing) recolour(dark.matches); });

  // What is in the window is drawn at once, the rest when it comes near: a report of many recordings opens quickly.
  const observer = new IntersectionObserver(function (entries) {
    entries.filter((entry) => entry.isIntersecting).forEach(function (entry) {
      observer.unobserve(entry.target);
      draw(entry.target);
    });
  }, { rootMargin: "1200px" });
  figures.forEach(function (figure) {
    if (figure.getBoundingClientRect().top < window.innerHeight) draw(figure);
    else observer.observe(figure);
  });

  // On paper each chart keeps to one page.
  window.addEventListener("beforeprint", function () {
    printing = true;
    figures.forEach(draw);
    if (dark.matches) recolour(false);
    figures.forEach(function (figure) {
      const own = Number(figure.dataset.height), height = Math.min(720, own), margin = figure.layout.margin;
      Plotly.relayout(figure, { width: 690, height: height });
      // The legend keeps its distance in pixels from the first panel.
      if (height < own && figure.dataset.legend) Plotly.relayout(figure, { "legend.y": 1 + 26 / (height - margin.t - margin.b) });
    });
  });
  window.addEventListener("afterprint", function () {
    printing = false;
    if (dark.matches) recolour(true);
    figures.forEach(function (figure) {
      Plotly.relayout(figure, { width: null, height: Number(figure.dataset.height), autosize: true });
      if (figure.dataset.legend) Plotly.relayout(figure, { "legend.y": Number(figure.dataset.legend) });
    });
  });
  if (window.playReplay) await window.playReplay();
})();
