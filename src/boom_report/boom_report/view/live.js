"use strict";
// The running machine: builds the player when the machine is known, and goes on when the stream does.
window.playLive = function () {
  const said = document.getElementById("state"), root = document.querySelector(".view");
  let player = null, data = null, pending = [];
  window.view = { get player() { return player; }, get data() { return data; } };

  const stream = new EventSource("stream");
  stream.addEventListener("scene", (event) => {
    const scene = JSON.parse(event.data), names = scene.channels.map((c) => c.name).concat(["retract_current", "extend_current"]);
    if (player) { location.reload(); return; }  // another machine: everything is drawn anew
    data = growing(names, scene.keep);
    player = makePlayer(root, scene, data);
    document.querySelector("h1").textContent = `Crane ${scene.machine}, live`;
    if (pending.length) { data.add(pending); pending = []; player.refresh(); }
  });
  stream.addEventListener("samples", (event) => {
    const rows = JSON.parse(event.data);
    if (!player) { pending = pending.concat(rows); return; }
    if (rows.length && data.time.length && rows[0][0] < data.time[data.time.length - 1]) data.clear();
    data.add(rows);
    player.grow();
  });
  stream.addEventListener("marks", (event) => { if (data) { data.models[0].marks = JSON.parse(event.data); } });
  stream.addEventListener("state", (event) => { said.textContent = JSON.parse(event.data); });
  stream.onerror = () => { said.textContent = "The program behind this page has ended: start ./boom view again, and this page goes on by itself."; };
};
