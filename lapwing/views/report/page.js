// Draws each plot when it is near the viewport, and links the time ranges of all plots.
(() => {
  const config = { responsive: true, displaylogo: false, scrollZoom: false, toImageButtonOptions: { format: "svg" } };
  Object.assign(config, { modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"], displayModeBar: matchMedia("(hover: hover)").matches && "hover" });
  const NARROW = 600; // [pixel] width below which a plot has one column
  const PAPER = 690, SHEET = 900; // [pixel] width and height of a plot on a page of A4
  const COLUMN = 230; // [pixel] width that a column of panels needs; on paper, a plot is scaled down for that
  const dark = DARK_COLOURS;
  const AROUND = [5, 10]; // [s] shown before and after a selected event
  const linked = []; // drawn plots over time: {box, axis}
  const unit = Number(document.body.dataset.seconds || 1); // [s] unit of the plots' time
  let range = null; // time range selected by the user

  function follow(plot, changed) {
    const selected = plot.box.layout[plot.axis].range;
    if (!Object.keys(changed).some((key) => plot.timed.some((axis) => key.startsWith(`${axis}.`)))) return;
    if (range && selected[0] === range[0] && selected[1] === range[1]) return; // a linked plot
    range = selected.slice();
    for (const other of linked) {
      if (other !== plot) Plotly.relayout(other.box, { [`${other.axis}.range`]: range.slice() });
    }
  }

  // Numbers in 16-bit steps of their range: see _array of plotly_figure.py. Typed arrays of plotly.js are unchanged.
  function numbers(encoded) {
    if (encoded?.steps === undefined) return encoded;
    const bytes = Uint8Array.from(atob(encoded.steps), (c) => c.charCodeAt(0)), count = bytes.length / 2;
    let n = 0;
    return Float64Array.from({ length: count }, (_, k) => {
      n = ((n + bytes[k] + 256 * bytes[k + count]) << 16) >> 16; // 16-bit overflow
      return n === -32768 ? NaN : encoded.low + (n + 32767) * encoded.step;
    });
  }

  const scheme = matchMedia("(prefers-color-scheme: dark)");
  const light = matchMedia("print");
  function coloured(text) {
    if (!scheme.matches || light.matches) return text;
    return text.replace(/#[0-9A-F]{6}\b/g, (colour) => dark[colour] ?? colour).replace(/rgba\((\d+),(\d+),(\d+),/g, (all, ...rgb) => {
      const colour = dark[`#${rgb.slice(0, 3).map((n) => Number(n).toString(16).padStart(2, "0")).join("").toUpperCase()}`];
      return colour ? `rgba(${[1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16))},` : all;
    });
  }
  scheme.addEventListener("change", () => location.reload());

  // On a phone the columns of a plot are stacked.
  function stack(layout, { height, top, domains, titles }) {
    Object.assign(layout, { height, margin: { ...layout.margin, l: 56, r: 6, t: top } });
    layout.annotations = layout.annotations.filter(({ name }) => name !== "wide");
    for (const [number, domain] of Object.entries(domains)) {
      layout[`xaxis${number}`].domain = [0, 1];
      layout[`yaxis${number}`].domain = domain;
    }
    for (const [axis, label] of Object.entries(titles)) layout[axis].title.text = label;
  }

  const drawn = new Map(); // promises of the plots
  function draw(figure) {
    if (!drawn.has(figure)) drawn.set(figure, begin(figure));
    return drawn.get(figure);
  }
  async function begin(figure) {
    const { data, layout, timed, narrow } = JSON.parse(coloured(texts.get(figure) ?? (await unpacked(figure.querySelector("script")))));
    if (narrow && figure.clientWidth < NARROW) stack(layout, narrow);
    for (const trace of data) for (const axis of ["x", "y"]) trace[axis] = numbers(trace[axis]);
    const box = figure.querySelector("div");
    if (range) for (const axis of timed) layout[axis].range = range.slice();
    if (printing) onPaper(figure, layout);
    await library;
    await Plotly.newPlot(box, data, layout, config);
    figure.dataset.drawn = "yes";
    if (!timed.length) return;
    const plot = { box, timed, axis: timed[0], panels: timed.map((axis) => `${axis}${axis.replace("x", "y")}`.replaceAll("axis", "")) };
    linked.push(plot);
    box.on("plotly_relayout", (changed) => follow(plot, changed));
    box.on("plotly_hover", ({ xvals }) => seek(xvals[0] * unit));
  }

  // A plot in a closed section is drawn when the section opens.
  const figures = [...document.querySelectorAll("figure.plot")];
  const texts = new Map(); // unpacked in advance, since printing cannot wait
  figures.forEach(async (figure) => texts.set(figure, await unpacked(figure.querySelector("script"))));
  const near = new IntersectionObserver(
    (entries) => entries.filter((entry) => entry.isIntersecting).forEach((entry) => draw(entry.target)),
    { rootMargin: "600px" },
  );
  figures.forEach((figure) => near.observe(figure));

  // The 3D view is a page in a frame; the two pages exchange the time by messages.
  const space = document.querySelector("#space .space");
  let frame = null, pending = null; // [s] time for a 3D view that is closed or not yet drawn
  function seek(time) {
    if (space?.dataset.time === undefined) pending = time;
    else frame.contentWindow.postMessage({ lapwing: "seek", time }, "*");
  }
  function visible({ box }) {
    const place = box.getBoundingClientRect();
    return box.offsetParent && place.bottom > 0 && place.top < innerHeight;
  }
  function hover(time) { // moves the cursor of the visible plots
    for (const plot of linked.filter(visible)) Plotly.Fx.hover(plot.box, { xval: time / unit }, plot.panels, true);
  }
  function show() {
    if (frame) return;
    frame = document.createElement("iframe");
    frame.title = "3D view";
    frame.srcdoc = JSON.parse(document.querySelector("#space script").textContent);
    space.replaceChildren(frame);
  }
  if (space) {
    addEventListener("message", ({ data, source }) => {
      if (source !== frame?.contentWindow || data?.lapwing !== "time") return;
      space.dataset.time = data.time;
      if (pending === null) hover(data.time);
      else seek(pending);
      pending = null;
    });
    const details = space.closest("details"); // loaded on demand: without a GPU it would delay the plots
    details.addEventListener("toggle", () => details.open && show());
  }

  // A click on the time of an event shows that time in all plots and in the 3D view.
  document.addEventListener("click", ({ target }) => {
    const time = Number(target.closest?.("button[data-time]")?.dataset.time ?? NaN);
    if (Number.isNaN(time)) return;
    seek(time);
    range = [(time - AROUND[0]) / unit, (time + AROUND[1]) / unit];
    for (const plot of linked) Plotly.relayout(plot.box, { [`${plot.axis}.range`]: range.slice() });
    const place = frame?.offsetParent ? space : linked.some(visible) ? null : document.querySelector("details[open] figure.plot");
    place?.scrollIntoView({ block: "center", behavior: "smooth" });
  });

  let printing = false;
  function onPaper(figure, layout) { // scales a plot to a page; returns its width before
    const columns = new Set(Object.entries(layout).filter(([key]) => key.startsWith("xaxis")).map(([, axis]) => axis.domain[0])).size;
    const width = Math.max(PAPER, COLUMN * columns, PAPER * layout.height / SHEET);
    Object.assign(figure.style, { width: `${width}px`, zoom: PAPER / width });
    return width;
  }
  function fit(paper) { // fits the plots to paper, or to the window again
    printing = paper;
    for (const figure of figures) {
      const box = figure.querySelector("div");
      const resize = () => Plotly.relayout(box, printing ? { width: onPaper(figure, box.layout) } : { width: null, autosize: true });
      if (!paper) Object.assign(figure.style, { width: "", zoom: "" });
      if (figure.dataset.drawn) resize();
      else draw(figure).then(resize);
    }
  }
  window.addEventListener("beforeprint", () => {
    for (const details of document.querySelectorAll("details")) details.open ||= !details.contains(space);
    fit(true);
  });
  window.addEventListener("afterprint", () => fit(false));
})();
