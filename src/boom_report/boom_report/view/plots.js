"use strict";
// Plots that follow: measured and model over a window of time; a line runs through it, and the window goes on when the line leaves it.
// So a frame moves four lines, and the curves are drawn only when the window moves or new data are there.
(function () {
  const WINDOW = 20, KEPT = 4;  // s shown, and how much of it is left behind when the window goes on

  const SPAN = { rad: 0.02, bar: 4, A: 0.2 };  // an axis shows at least so much: a sensor's noise is not to fill it
  function range(low, high, least) {
    if (low === null) return [0, least];
    const more = Math.max(0.06 * (high - low), (least - (high - low)) / 2);
    return [low - more, high + more];
  }

  window.makePlots = function (root, channels, onSeek) {
    const css = (name) => getComputedStyle(root).getPropertyValue(name).trim();
    let colours, plots = [], marks = [], live = false, shown = [Infinity, -Infinity], dirty = true;
    const stroke = (name) => () => colours[name];
    const rows = [
      ...channels.filter((c) => ["angle", "hose_pressure", "rod_pressure"].includes(c.name)),
      { name: "currents", label: "current", unit: "A", scale: 1 },
    ];

    function shade(plot, channel) {
      const ctx = plot.ctx, x = (t) => plot.valToPos(t, "x", true), { left, top, width, height } = plot.bbox;
      ctx.save();
      ctx.beginPath();
      ctx.rect(left, top, width, height);
      ctx.clip();
      ctx.fillStyle = colours.shade;
      marks.filter((m) => m.channel === channel.name && m.end > plot.scales.x.min && m.start < plot.scales.x.max)
        .forEach((m) => ctx.fillRect(x(m.start), top, Math.max(2, x(m.end) - x(m.start)), height));
      ctx.restore();
    }

    function make() {
      plots.forEach(({ plot }) => plot.destroy());
      root.textContent = "";
      colours = { machine: css("--machine-line"), model: css("--model"), ink: css("--ink"), quiet: css("--quiet"), line: css("--line"), shade: css("--shade") };
      plots = rows.map((channel) => {
        const currents = channel.name === "currents", holder = document.createElement("div");
        holder.className = "plot";
        const title = document.createElement("p");
        title.textContent = `${channel.label} [${channel.unit}]`;
        if (currents) title.textContent += ": lifting up, lowering down";
        holder.append(title);
        root.append(holder);
        const axis = { stroke: stroke("quiet"), grid: { stroke: stroke("line"), width: 1 }, ticks: { show: false }, font: "11px system-ui, sans-serif" };
        const plot = new uPlot({
          width: Math.max(200, root.clientWidth), height: currents ? 84 : 104, legend: { show: false }, cursor: { show: true, y: false, drag: { x: false, y: false } },
          scales: { x: { time: false }, y: { range: (_, low, high) => range(low, high, SPAN[channel.unit] || 1) } },
          axes: [{ ...axis, size: 22, values: (_, v) => v.map((s) => `${s} s`) }, { ...axis, size: 46 }],
          series: [{}, { stroke: stroke("model"), width: 3, points: { show: false } }, { stroke: stroke("machine"), width: 1.3, points: { show: false } }],
          hooks: { drawClear: [(p) => shade(p, channel)] },
        }, [[], [], []], holder);
        const line = document.createElement("i");
        line.className = "now";
        plot.over.append(line);
        plot.over.addEventListener("click", (e) => onSeek(plot.posToVal(e.offsetX, "x")));
        return { plot, channel, line };
      });
    }
    const scaled = (values, scale) => (scale === 1 ? values : Array.from(values, (v) => v * scale));
    const unknown = (values) => Array.from(values, (v) => (Number.isFinite(v) ? v : null));

    // New data, or another model; for live data this is called for every batch.
    function set(data, model) {
      live = data.live;
      dirty = true;
      marks = model ? model.marks : [];
      plots.forEach(({ plot, channel }) => {
        let one, two;
        if (channel.name === "currents") {
          const { retract_current: r, extend_current: e } = data.measured;
          one = e && r ? Array.from(e, (v, i) => v - r[i]) : [];
          two = Array.from(one, () => null);
        } else {
          one = scaled(data.measured[channel.name] || [], channel.scale);
          two = model ? scaled(model.values[channel.name] || [], channel.scale) : [];
        }
        if (!one.length) one = Array.from(data.time, () => null);
        if (!two.length) two = Array.from(one, () => null);
        plot.setData([data.time, unknown(two), unknown(one)], false);
      });
    }
    function show(t, first, last) {
      const end = Math.max(shown[1], shown[0] + 1);
      if (t < shown[0] || t > end || dirty) {
        const length = Math.min(WINDOW, Math.max(1, live ? WINDOW : last - first));
        let begin = t < shown[0] || t > end ? t - KEPT : shown[0];
        begin = Math.max(first, live ? begin : Math.min(begin, last - length));
        shown = [begin, begin + length];
        plots.forEach(({ plot }) => plot.setScale("x", { min: shown[0], max: shown[1] }));
        dirty = false;
      }
      const share = (t - shown[0]) / (shown[1] - shown[0]);
      plots.forEach(({ plot, line }) => { line.style.transform = `translateX(${((share * plot.bbox.width) / devicePixelRatio).toFixed(1)}px)`; });
    }
    let width = 0;
    new ResizeObserver(() => {
      if (root.clientWidth === width) return;
      width = root.clientWidth;
      plots.forEach(({ plot }) => plot.setSize({ width: Math.max(200, width), height: plot.height }));
    }).observe(root);
    make();
    return { set, show, make };
  };
})();
