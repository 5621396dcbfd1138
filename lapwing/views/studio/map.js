// Map of a scene from the side: start, waypoints, buildings and wind, which are dragged; it reads and writes the form.
(() => {
  const form = document.querySelector("#scene"), svg = document.querySelector("#map");
  if (!form || !svg) return;
  const AZIMUTH = 0.61, ELEVATION = 0.49, WIDTH = 480, HEIGHT = 300, MARGIN = 24, WIND = 1.5; // [rad]; [pixel]; [s] of wind shown
  const [ca, sa, ce, se] = [Math.cos(AZIMUTH), Math.sin(AZIMUTH), Math.cos(ELEVATION), Math.sin(ELEVATION)];
  const flat = ([x, y, z = 0]) => [ca * x + sa * y, -(se * (ca * y - sa * x) + ce * z)];
  const input = (name) => form.querySelector(`[name="${name}"]`);
  const read = (name) => { // numbers of a field; null without them
    try {
      return JSON.parse(input(name).value);
    } catch {
      return null;
    }
  };
  const write = (name, value) => {
    const text = (item) => (Array.isArray(item) ? `[${item.map(text).join(", ")}]` : item.toFixed(1));
    input(name).value = text(value);
    input(name).dispatchEvent(new Event("input", { bubbles: true }));
  };
  const WINDS = ["effects.wind_constant.velocity", "effects.random_wind_force.mean"];
  const numbers = (list) => Array.isArray(list) && list.every((item) => typeof item === "number");
  function shapes() { // start [m]; waypoints [m] from the start; corners of buildings; wind [m/s]
    const start = read("vehicle.initial_position") ?? [0, 0], points = read("trajectory.waypoints");
    const solids = [...form.querySelectorAll("[name^='environment.terrain.'][name$='.position']")].map(({ name }) => {
      const at = name.slice(0, -"position".length), [x, y] = read(name) ?? [0, 0], top = Number(input(`${at}top`)?.value) || 0;
      const radius = Number(input(`${at}radius`)?.value), [a, b] = read(`${at}size`) ?? [2 * radius, 2 * radius];
      const turn = Number(input(`${at}heading`)?.value) || 0, [c, s] = [Math.cos(turn), Math.sin(turn)];
      const corners = [[-a, -b], [a, -b], [a, b], [-a, b]].map(([u, v]) => [x + (c * u - s * v) / 2, y + (s * u + c * v) / 2]);
      return { name, place: [x, y, top], corners, top };
    });
    return {
      start: numbers(start) ? start : [0, 0], points: points?.every?.(numbers) ? points : null, solids,
      wind: WINDS.map((name) => ({ name, value: read(name) })).find(({ value }) => numbers(value)),
    };
  }
  let scale = 1, shift = [0, 0], held = null;
  const pixel = (place) => flat(place).map((value, k) => shift[k] + scale * value);
  const make = (kind, attributes, text = "") => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", kind);
    for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
    node.textContent = text;
    return svg.appendChild(node);
  };
  const line = (places, kind, css) => make(kind, { points: places.map((place) => pixel(place).join()).join(" "), class: css });
  function handle(place, css, label, onMove, onRemove) {
    const [cx, cy] = pixel(place), dot = make("circle", { cx, cy, r: 10, class: `handle ${css}` });
    make("text", { x: cx + 13, y: cy + 4 }, label);
    dot.onpointerdown = (event) => {
      held = { onMove, place, from: [event.clientX, event.clientY] };
      svg.setPointerCapture(event.pointerId);
      event.preventDefault();
    };
    if (onRemove) dot.ondblclick = (event) => (event.stopPropagation(), onRemove());
  }
  function draw() {
    const { start, points, solids, wind } = shapes(), [x0, y0] = start, home = [x0, y0, 0];
    const route = points?.map(([x, y, z]) => [x0 + x, y0 + y, z]);
    if (!held) { // the view stays during a motion
      const all = [home, ...(route ?? []), ...solids.flatMap(({ corners, top }) => corners.flatMap(([x, y]) => [[x, y, 0], [x, y, top]]))];
      const reach = Math.max(5, ...all.flatMap(([x, y]) => [Math.abs(x - x0), Math.abs(y - y0)])) * 1.2;
      const ends = [...all, ...[-reach, reach].flatMap((a) => [-reach, reach].map((b) => [x0 + a, y0 + b, 0]))].map(flat);
      const low = [0, 1].map((k) => Math.min(...ends.map((end) => end[k]))), high = [0, 1].map((k) => Math.max(...ends.map((end) => end[k])));
      scale = Math.min((WIDTH - 2 * MARGIN) / (high[0] - low[0]), (HEIGHT - 2 * MARGIN) / (high[1] - low[1]));
      shift = [WIDTH / 2 - scale * (low[0] + high[0]) / 2, HEIGHT / 2 - scale * (low[1] + high[1]) / 2];
      svg.dataset.reach = reach;
    }
    svg.replaceChildren();
    const reach = Number(svg.dataset.reach), step = 10 ** Math.floor(Math.log10(reach));
    for (let k = -Math.floor(reach / step); k <= reach / step; k++) {
      line([[x0 + k * step, y0 - reach], [x0 + k * step, y0 + reach]], "polyline", "grid-line");
      line([[x0 - reach, y0 + k * step], [x0 + reach, y0 + k * step]], "polyline", "grid-line");
    }
    make("text", { x: 8, y: HEIGHT - 8 }, `${step} m between the lines; x east, y north`);
    for (const { name, place, corners, top } of solids) {
      corners.forEach((corner, k) => line([corner, corners[(k + 1) % 4], [...corners[(k + 1) % 4], top], [...corner, top]], "polygon", "solid"));
      line(corners.map((corner) => [...corner, top]), "polygon", "solid");
      handle(place, "building", "", ([x, y]) => write(name, [x, y]));
    }
    if (route) {
      route.forEach((place) => line([place, [...place.slice(0, 2), 0]], "polyline", "drop"));
      line([home, [...start, route[0][2]], ...route], "polyline", "path");
      const set = (k, at) => write("trajectory.waypoints", points.map((point, i) => (i === k ? [at[0] - x0, at[1] - y0, at[2], ...point.slice(3)] : point)));
      route.forEach((place, k) => handle(place, "waypoint", k + 1, (at) => set(k, at),
        points.length > 1 ? () => (write("trajectory.waypoints", points.toSpliced(k, 1)), draw()) : null));
    }
    if (input("vehicle.initial_position")) handle(home, "start", "start", ([x, y]) => write("vehicle.initial_position", [x, y]));
    if (wind) {
      const [u, v, w = 0] = wind.value, tip = [x0 + WIND * u, y0 + WIND * v, 0];
      line([home, tip], "polyline", "wind");
      handle(tip, "wind", `wind ${Math.hypot(u, v).toFixed(1)} m/s`, ([x, y]) => write(wind.name, [(x - x0) / WIND, (y - y0) / WIND, w]));
    }
  }
  svg.onpointermove = ({ clientX, clientY, shiftKey }) => {
    if (!held) return;
    const size = WIDTH / svg.getBoundingClientRect().width / scale, [x, y, z = 0] = held.place;
    const right = (clientX - held.from[0]) * size, down = (clientY - held.from[1]) * size, away = -down / se;
    held.onMove(shiftKey ? [x, y, Math.max(0, z - down / ce)] : [x + ca * right - sa * away, y + sa * right + ca * away, z]);
    draw();
  };
  svg.onpointerup = svg.onpointercancel = () => {
    held = null;
    draw();
  };
  svg.ondblclick = (event) => { // a new waypoint on the ground point, at the height of the last one
    const { start, points } = shapes(), box = svg.getBoundingClientRect(), size = WIDTH / box.width;
    if (!points) return;
    const right = ((event.clientX - box.left) * size - shift[0]) / scale, away = -((event.clientY - box.top) * size - shift[1]) / scale / se;
    write("trajectory.waypoints", [...points, [ca * right - sa * away - start[0], sa * right + ca * away - start[1], points.at(-1)[2]]]);
  };
  form.addEventListener("input", () => held || draw());
  const { points } = shapes();
  document.querySelector("#map-help").textContent = `Drag what you want to move${points ? "; with Shift, a waypoint up and down. Double-click the ground to add a waypoint, a waypoint to remove it" : ""}.`;
  draw();
})();
