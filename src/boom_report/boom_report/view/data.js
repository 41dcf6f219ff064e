"use strict";
// What a player reads: series of a recording, or of the running machine.
(function () {
  const each = (columns) => Object.fromEntries(Object.entries(columns).map(([name, packed]) => [name, packing.numbers(packed)]));

  // What a player reads: time (n,), measured and models by channel, marks.
  window.recorded = function (document) {
    const measured = each(document.measured), n = measured.angle.length;
    return {
      name: document.name, live: false, time: Float64Array.from({ length: n }, (_, i) => i * document.period), measured,
      models: document.models.map((m) => ({ label: m.label, values: each(m.values), marks: m.marks })),
    };
  };

  // The same, growing: rows [t, measured..., model...] that come from the stream; the oldest leave after `keep` seconds.
  window.growing = function (channels, keep) {
    const empty = () => Object.fromEntries(channels.map((name) => [name, []]));
    const data = { name: "", live: true, time: [], measured: empty(), models: [{ label: "model", values: empty(), marks: [] }] };
    const number = (v) => (v === null ? NaN : v);
    data.add = function (rows) {
      rows.forEach((row) => {
        data.time.push(row[0]);
        channels.forEach((name, i) => {
          data.measured[name].push(number(row[1 + i]));
          data.models[0].values[name].push(number(row[1 + channels.length + i]));
        });
      });
      const old = data.time.findIndex((t) => t >= data.time[data.time.length - 1] - keep);
      if (old > 600) {  // in portions: taking one off at a time costs more than the drawing
        data.time.splice(0, old);
        [data.measured, data.models[0].values].forEach((c) => channels.forEach((name) => c[name].splice(0, old)));
      }
    };
    data.clear = function () {
      data.time.length = 0;
      data.models[0].marks = [];
      [data.measured, data.models[0].values].forEach((c) => channels.forEach((name) => { c[name].length = 0; }));
    };
    return data;
  };

  // Index of the last sample at or before t; -1 before the first.
  window.indexAt = function (time, t) {
    let a = -1, b = time.length;
    while (b - a > 1) { const m = (a + b) >> 1; if (time[m] <= t) a = m; else b = m; }
    return a;
  };
  // Value at t, interpolated between neighbours; null where there is none.
  window.valueAt = function (time, values, t, k) {
    if (!values || k < 0) return null;
    const v = values[k], next = values[k + 1], span = time[k + 1] - time[k];
    if (!Number.isFinite(v)) return null;
    return Number.isFinite(next) && span > 0 && span < 0.2 ? v + ((next - v) * Math.min(1, (t - time[k]) / span)) : v;
  };
})();
