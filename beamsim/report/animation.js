/* Starts the animation of a page without plots. */
"use strict";
(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  if (data.animation) player(document.getElementById("animation"), data.animation, {
    play: document.getElementById("play"), position: document.getElementById("position"),
    pace: document.getElementById("pace"),
  });
  document.body.dataset.drawn = 0;
})();
