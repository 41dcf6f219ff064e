"use strict";
// A recording: unpacked from the page itself.
window.playReplay = async function () {
  const { scene, series } = JSON.parse(await packing.inflatedText(document.getElementById("replay").textContent));
  window.view = { player: makePlayer(document.querySelector(".view"), scene, recorded(series)) };
};
