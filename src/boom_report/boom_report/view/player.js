"use strict";
// One player for a recording, a report and the running machine: time, crane, scheme, plots, marks.
(function () {
  const SMOOTH = 0.08;  // s that a live picture lags: samples arrive in batches
  const FLOWING = 0.03;  // s between two pictures of the scheme: painting it takes a seventh of a frame
  const READABLE = 100;  // ms between two texts, and between two drawings of curves that grow
  const channelsOf = (scene) => scene.channels;

  window.makePlayer = function (root, scene, data) {
    const one = (name) => root.querySelector(`[data-view="${name}"]`);
    const canvas = one("canvas"), slider = one("time"), play = one("play"), speed = one("speed"), mode = one("ghost"), which = one("model");
    const crane = makeCrane3d(canvas);
    if (!crane) { canvas.hidden = true; one("no-webgl").hidden = false; } else crane.set(scene);
    one("scheme").innerHTML = scene.scheme;  // drawn and escaped by boom_report.scheme
    const colour = makeScheme(one("scheme"));
    const plots = makePlots(one("plots"), channelsOf(scene), (t) => { seek(t); });
    const state = { t: data.live ? null : 0, playing: !root.closest(".moving.card"), follow: data.live, model: data.models[0] || null, drawn: null, read: 0, flowed: 0, grown: false, curves: 0, frames: 0, since: performance.now() };
    const first = () => (data.time.length ? data.time[0] : 0), last = () => (data.time.length ? data.time[data.time.length - 1] : 0);

    data.models.forEach((m, i) => which.add(new Option(m.label, i)));
    which.parentElement.hidden = data.models.length < 2;
    which.onchange = () => { state.model = data.models[Number(which.value)]; refresh(); };
    mode.onchange = () => { state.drawn = null; };
    play.onclick = () => {
      if (!state.playing && !data.live && state.t >= last()) state.t = first();
      state.playing = !state.playing;
      if (data.live && state.playing) state.follow = true;
      label();
    };
    slider.oninput = () => { state.playing = state.follow = false; state.t = Number(slider.value); state.drawn = null; label(); };
    one("home").onclick = () => crane && crane.home();
    function seek(t) { state.t = Math.max(first(), Math.min(last(), t)); state.follow = false; if (data.live) state.playing = false; state.drawn = null; label(); }
    function label() {
      play.textContent = state.playing ? "Pause" : data.live ? "Live" : "Play";
      speed.parentElement.hidden = data.live;
    }

    function strip() {  // where machine and model part, above the slider
      const holder = one("marks");
      holder.textContent = "";
      const span = Math.max(1e-3, last() - first());
      (state.model ? state.model.marks : []).slice(0, 400).forEach((mark) => {
        const element = document.createElement("i"), channel = channelsOf(scene).find((c) => c.name === mark.channel);
        element.style.left = `${(100 * (mark.start - first())) / span}%`;
        element.style.width = `${Math.max(0.3, (100 * (mark.end - mark.start)) / span)}%`;
        element.title = `${channel.label}: up to ${(mark.largest * channel.scale).toPrecision(3)} ${channel.unit} apart, ${mark.start.toFixed(1)} to ${mark.end.toFixed(1)} s`;
        element.onclick = () => seek(mark.start);
        holder.append(element);
      });
    }
    function refresh() {
      state.grown = false;
      state.curves = performance.now();
      plots.set(data, state.model);
      slider.min = first();
      slider.max = last();
      strip();
      state.drawn = null;
    }

    const tipOf = (angle) => { const [x, y] = scene.boom[2]; return [x * Math.cos(angle) - y * Math.sin(angle), x * Math.sin(angle) + y * Math.cos(angle)]; };
    // Flow by the piston's speed [m^3/s]: what is measured knows no other.
    function flows(k) {
      const angle = data.measured.angle, a = Math.max(0, k - 2), b = Math.min(data.time.length - 1, k + 3), dt = data.time[b] - data.time[a];
      if (!(dt > 0) || !Number.isFinite(angle[a]) || !Number.isFinite(angle[b])) return { head: null, rod: null };
      const speed = (interpolatedPin(scene.angles, scene.piston, angle[b]) - interpolatedPin(scene.angles, scene.piston, angle[a])) / dt;
      const still = Math.abs(speed) < 1.5e-3;
      return { head: still ? 0 : scene.area[0] * speed, rod: still ? 0 : -scene.area[1] * speed };
    }
    function say(t, angle, ghost, parted) {
      const said = [`${t.toFixed(2)} s`];
      if (angle !== null) said.push(`boom ${angle.toFixed(4)} rad`);
      if (ghost !== null && angle !== null) {
        const a = tipOf(angle), b = tipOf(ghost);
        said.push(`model ${ghost.toFixed(4)} rad, tip ${(1e3 * Math.hypot(a[0] - b[0], a[1] - b[1])).toFixed(0)} mm apart`);
      }
      one("said").textContent = said.join(" · ");
      one("apart").textContent = parted.length ? `parts: ${parted.join(", ")}` : "";
    }
    function draw(t, elapsed) {
      const k = indexAt(data.time, t), value = (columns, name) => valueAt(data.time, columns && columns[name], t, k);
      const m = data.measured, g = state.model && state.model.values, angle = value(m, "angle"), ghost = value(g, "angle");
      const parted = state.model ? [...new Set(state.model.marks.filter((x) => x.start <= t && t <= x.end).map((x) => channelsOf(scene).find((c) => c.name === x.channel).label))] : [];
      if (crane) crane.show(angle, ghost, mode.value, parted.length > 0);
      plots.show(t, first(), last());
      state.flowed += elapsed;
      if (!state.playing || state.flowed >= FLOWING) flow(m, value, k);
      if (state.playing && performance.now() - state.read < READABLE) return;  // numbers that change faster cannot be read
      state.read = performance.now();
      slider.value = t;
      say(t, angle, ghost, parted);
    }
    function flow(m, value, k) {
      const head = value(m, "head_pressure") ?? (scene.holds ? null : value(m, "hose_pressure"));
      colour({ hose: value(m, "hose_pressure"), rod: value(m, "rod_pressure"), head, supply: value(m, "supply_pressure") ?? scene.supply, tank: value(m, "tank_pressure") ?? scene.tank },
        flows(k), [value(m, "retract_current"), value(m, "extend_current")], state.flowed);
      state.flowed = 0;
    }
    let before = performance.now();
    function frame(now) {
      requestAnimationFrame(frame);
      const elapsed = Math.min(0.25, (now - before) / 1e3);
      before = now;
      if (!data.time.length || (root.getBoundingClientRect().bottom < 0 || root.getBoundingClientRect().top > window.innerHeight)) return;
      if (state.grown && now - state.curves >= READABLE) refresh();
      if (data.live && state.follow) {
        const goal = last() - SMOOTH;  // follows the newest sample without jumping with the batches
        state.t = state.t === null || Math.abs(goal - state.t) > 0.5 ? goal : state.t + elapsed + 0.1 * (goal - state.t - elapsed);
        state.t = Math.min(state.t, last());
      } else if (state.playing && !data.live) {
        state.t += elapsed * Number(speed.value);
        if (state.t >= last()) { state.t = last(); state.playing = false; label(); }
      }
      if (state.drawn !== state.t) { draw(state.t, elapsed); state.drawn = state.t; state.frames += 1; }
      if (crane) crane.paint();
      if (now - state.since > 1000) {
        one("rate").textContent = `${((1e3 * state.frames) / (now - state.since)).toFixed(0)} frames/s`;
        state.frames = 0;
        state.since = now;
      }
    }
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { plots.make(); refresh(); });
    label();
    refresh();
    requestAnimationFrame(frame);
    return { refresh, grow: () => { state.grown = true; }, state, seek };
  };
})();
