// Draws each plot when it comes near the window, and shows the same stretch of time in all of them.
(() => {
  const config = { responsive: true, displaylogo: false, scrollZoom: false, toImageButtonOptions: { format: "svg" } };
  const linked = []; // plots over time that have been drawn: {box, axis}
  const unit = Number(document.body.dataset.seconds || 1); // in a unit of the plots' time
  let range = null; // of time, as somebody has chosen it

  function follow(plot, changed) {
    const wanted = plot.box.layout[plot.axis].range;
    if (!Object.keys(changed).some((key) => plot.timed.some((axis) => key.startsWith(`${axis}.`)))) return;
    if (range && wanted[0] === range[0] && wanted[1] === range[1]) return; // this plot has only followed
    range = wanted.slice();
    for (const other of linked) {
      if (other !== plot) Plotly.relayout(other.box, { [`${other.axis}.range`]: range.slice() });
    }
  }

  async function draw(figure) {
    if (figure.dataset.drawn) return;
    figure.dataset.drawn = "yes";
    const { data, layout, timed } = JSON.parse(figure.querySelector("script").textContent);
    const box = figure.querySelector("div");
    if (range) for (const axis of timed) layout[axis].range = range.slice();
    await library;
    await Plotly.newPlot(box, data, layout, config);
    if (!timed.length) return;
    const plot = { box, timed, axis: timed[0], panels: timed.map((axis) => `${axis}${axis.replace("x", "y")}`.replaceAll("axis", "")) };
    linked.push(plot);
    box.on("plotly_relayout", (changed) => follow(plot, changed));
    box.on("plotly_hover", ({ xvals }) => document.dispatchEvent(new CustomEvent("plot-time", { detail: xvals[0] * unit })));
  }

  // The cursor of the plots that can be seen, at a time that somebody else has chosen.
  document.addEventListener("motion-time", ({ detail }) => {
    for (const { box, panels } of linked) {
      const place = box.getBoundingClientRect();
      if (place.bottom > 0 && place.top < innerHeight) Plotly.Fx.hover(box, { xval: detail / unit }, panels, true);
    }
  });

  const figures = [...document.querySelectorAll("figure.plot")];
  const near = new IntersectionObserver(
    (entries) => entries.filter((entry) => entry.isIntersecting).forEach((entry) => draw(entry.target)),
    { rootMargin: "600px" },
  );
  figures.forEach((figure) => near.observe(figure));
  window.addEventListener("beforeprint", () => figures.forEach(draw));
})();
