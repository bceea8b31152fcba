/* Unpacks plotly, which the page holds compressed, and draws the plots and the animation. */
"use strict";
(async function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  const canvas = document.getElementById("animation");
  if (canvas) player(canvas, data.animation, {
    play: document.getElementById("play"), position: document.getElementById("position"),
    pace: document.getElementById("pace"),
  });
  const plots = data.plots.map((plot, k) => [document.getElementById("plot-" + k), plot]);
  try {
    const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent), c => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.head.append(script);
  } catch (error) {
    plots.forEach(([place]) => { place.textContent = "This browser cannot unpack the plots: " + error; });
    return;
  }
  const config = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["lasso2d", "select2d"],
                   toImageButtonOptions: { format: "svg" } };
  for (const [place, plot] of plots) await Plotly.newPlot(place, plot.data, plot.layout, config);
  const fit = width => plots.forEach(([place]) =>
    Plotly.relayout(place, width ? { width } : { width: null, autosize: true }));
  window.addEventListener("beforeprint", () => {
    document.querySelectorAll("details").forEach(part => { part.open = true; });
    fit(690);
  });
  window.addEventListener("afterprint", () => fit(null));
  document.body.dataset.drawn = plots.length;
})();
