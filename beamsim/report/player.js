/* Plays an animation on a canvas: player(canvas, scene, controls). Heights are rows of the sketch above rest. */
"use strict";
function player(canvas, scene, controls) {
  const context = canvas.getContext("2d"), BODY = "#0b3c5d", STOP = "#d1495b", GREY = "#777";
  const [left, right, low, high] = scene.limits, frames = scene.time.length;
  let frame = 0, playing = !window.matchMedia("(prefers-reduced-motion: reduce)").matches, last = 0, pace = 1;
  const X = x => (x - left) / (right - left) * canvas.width, Y = y => (high - y) / (high - low) * canvas.height;
  function stroke(points, colour, width, dash) {
    context.strokeStyle = colour; context.lineWidth = width; context.setLineDash(dash || []);
    context.beginPath();
    points.forEach(([x, y], k) => k ? context.lineTo(X(x), Y(y)) : context.moveTo(X(x), Y(y)));
    context.stroke(); context.setLineDash([]);
  }
  function force(newton) {
    const size = Math.abs(newton);
    if (size < 1e-9) return "0 N";
    return size >= 1e3 ? (newton / 1e3).toPrecision(4) + " kN" : size >= 1 ? newton.toPrecision(4) + " N"
      : (newton * 1e3).toPrecision(4) + " mN";
  }
  function spring(stop) {
    const ends = stop.ends[frame], y = stop.y.map((v, k) => v + ends[k]);
    if (stop.x.length === 2) {
      if (stop.y[0] === stop.y[1]) {
        const top = stop.y[0] + stop.height;
        return [[stop.x[0], y[0]], [stop.x[0], top], [stop.x[1], top], [stop.x[1], y[1]]];
      }
      return [[stop.x[1], y[1]], [stop.x[0], stop.face[frame]]];
    }
    const face = stop.face[frame], width = 0.009 * (right - left);
    const across = [-1.6, 1.6, 0, 0, 1, -1, 1, -1, 0, 0, -2, 2];
    return [0, 0, 0, .15, .3, .45, .6, .75, .88, 1, 1, 1].map((share, k) =>
      [stop.x[0] + across[k] * width, face + (stop.mounting_row - face) * share]);
  }
  function draw() {
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.font = "14px system-ui, sans-serif"; context.textAlign = "left"; context.fillStyle = "#444";
    scene.lines.forEach(line => stroke(line.x.map((x, k) => [x, line.y[k]]), "#bbb", 1));
    const at = scene.lines.flatMap(line => line.x.map((x, k) => [x, line.y[k]]));
    scene.supports.forEach(([kind, point]) => {
      const x = at[point][0] + scene.shifts[frame][point], y = at[point][1] + scene.heights[frame][point];
      context.fillStyle = "#444"; context.beginPath();
      if (kind === "clamped") context.rect(X(x) - 6, Y(y) - 14, 6, 28);
      else { context.moveTo(X(x), Y(y)); context.lineTo(X(x) - 8, Y(y) + 14); context.lineTo(X(x) + 8, Y(y) + 14); }
      context.fill();
    });
    scene.names.forEach(([name, x, y]) => context.fillText(name, X(x) + 4, Y(y) - 12));
    scene.stops.forEach(stop => {
      const shut = stop.force[frame] !== 0;
      stroke(spring(stop), shut ? STOP : GREY, shut ? 3.2 : 1.4, stop.side === "separation" ? [6, 4] : []);
    });
    let first = 0;
    scene.lines.forEach(line => {
      const points = line.x.map((x, k) => [x + scene.shifts[frame][first + k], line.y[k] + scene.heights[frame][first + k]]);
      first += line.x.length;
      stroke(points, BODY, line.dots ? 1 : 2.5);
      context.fillStyle = BODY;
      if (line.dots) points.forEach(([x, y]) => context.fillRect(X(x) - 5, Y(y) - 5, 10, 10));
    });
    const end = right - 0.09 * (right - left), middle = scene.bar / 2;
    stroke([[end, -middle], [end, middle]], "#000", 2);
    context.fillStyle = "#000"; context.fillText(scene.bar_text, X(end) + 5, Y(0) + 5);
    context.textAlign = "right";
    const forces = scene.stops.slice(0, 6).map(stop => stop.name + " " + force(stop.force[frame])).join("   ");
    context.fillText("t = " + scene.time[frame].toFixed(5) + " s   " + forces, canvas.width - 8, 18);
    if (scene.slow[frame]) { context.fillStyle = STOP; context.fillText("slow motion", canvas.width - 8, 36); }
    controls.position.value = frame;
    controls.play.textContent = playing ? "Pause" : "Play";
  }
  function tick(now) {
    if (playing && now - last >= scene.milliseconds / pace) { last = now; frame = (frame + 1) % frames; draw(); }
    window.requestAnimationFrame(tick);
  }
  controls.position.max = frames - 1;
  controls.play.addEventListener("click", () => { playing = !playing; draw(); });
  controls.position.addEventListener("input", () => { playing = false; frame = +controls.position.value; draw(); });
  controls.pace.addEventListener("change", () => { pace = +controls.pace.value; });
  draw();
  window.requestAnimationFrame(tick);
}
