// The scene in 3D: start, waypoints, buildings, fences and wind, which are placed and dragged; it reads and writes the form.
(() => {
  const form = document.querySelector("#scene"), svg = document.querySelector("#map");
  if (!form || !svg) return;
  const WIDTH = 480, HEIGHT = 320, MARGIN = 24, WIND = 1.5; // [pixel]; [s] of wind shown
  const view = { azimuth: 0.61, elevation: 0.49, zoom: 1 }; // [rad]
  let ca, sa, ce, se;
  const flat = ([x, y, z = 0]) => [ca * x + sa * y, -(se * (ca * y - sa * x) + ce * z)];
  const input = (name) => form.querySelector(`[name="${name}"]`);
  const read = (name) => { // numbers, lists and tables of a field; null without them
    try {
      return JSON.parse(input(name).value.replace(/([\w-]+)\s*=/g, '"$1":'));
    } catch {
      return null;
    }
  };
  const text = (value) => {
    if (Array.isArray(value)) return `[${value.map(text).join(", ")}]`;
    if (typeof value === "object") return `{${Object.entries(value).map(([key, item]) => `${key} = ${text(item)}`).join(", ")}}`;
    return Number.isInteger(value) ? value.toFixed(1) : JSON.stringify(value);
  };
  const write = (name, value) => {
    input(name).value = text(value);
    input(name).dispatchEvent(new Event("input", { bubbles: true }));
  };
  const rounded = (...values) => values.map((value) => Math.round(10 * value) / 10 + 0); // [m]; without -0
  const WAYPOINTS = "trajectory.waypoints", START = "vehicle.initial_position";
  const BOX = "environment.terrain.box", TOWER = "environment.terrain.cylinder", KEEP_IN = "fence.keep_in", KEEP_OUT = "fence.keep_out";
  const WINDS = ["effects.wind_constant.velocity", "effects.random_wind_force.mean"];
  const numbers = (list) => Array.isArray(list) && list.every((item) => typeof item === "number");
  const tables = (name) => read(name) ?? [];
  const replace = (name, k, ...items) => write(name, tables(name).toSpliced(k, 1, ...items));
  const change = (name, k, values) => replace(name, k, { ...tables(name)[k], ...values });
  const ring = ([x, y], radius, count = 32) => Array.from({ length: count }, (_, k) => 2 * Math.PI * k / count)
    .map((angle) => [x + radius * Math.cos(angle), y + radius * Math.sin(angle)]);
  const centre = (corners) => [0, 1].map((k) => corners.reduce((sum, corner) => sum + corner[k], 0) / corners.length);

  function shapes() { // start [m]; waypoints [m] from the start; areas with their corners [m]; wind [m/s]
    const start = read(START) ?? [0, 0], points = read(WAYPOINTS);
    const areas = [BOX, TOWER, KEEP_IN, KEEP_OUT].flatMap((name) => tables(name).flatMap((table, k) => {
      if (!(numbers(table.position) && (table.size ?? table.radius)) && !table.corners?.every?.(numbers)) return []; // incomplete text
      const { position: at, radius, size, heading = 0, top = 0 } = table, [c, s] = [Math.cos(heading), Math.sin(heading)];
      const corners = size ? [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => [a * size[0] / 2, b * size[1] / 2])
        .map(([u, v]) => [at[0] + c * u - s * v, at[1] + s * u + c * v]) : table.corners ?? ring(at, radius);
      return { name, k, table, corners, at: at ?? centre(corners), top, heading: [c, s] };
    }));
    const wind = WINDS.map((name) => ({ name, value: read(name) })).find(({ value }) => numbers(value));
    return { start: numbers(start) ? start : [0, 0], points: points?.every?.((point) => numbers(point) && point.length > 2) ? points : null, areas, wind };
  }

  const labels = []; // attributes and texts, drawn above everything else
  let tracks = []; // places of the paths of a trajectory of phases [m]
  let scale = 1, shift = [0, 0], middle = [0, 0], reach = 5, held = null, tool = null;
  const pixel = (place) => flat(place).map((value, k) => shift[k] + scale * value);
  const make = (kind, attributes, label = "") => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", kind);
    for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
    node.textContent = label;
    return svg.appendChild(node);
  };
  const line = (places, kind, css) => make(kind, { points: places.map((place) => pixel(place).join()).join(" "), class: css });
  const grab = (event, place, onMove) => {
    held = { onMove, place, from: [event.clientX, event.clientY] };
    svg.setPointerCapture(event.pointerId);
    event.preventDefault();
    event.stopPropagation();
  };
  function handle(place, css, label, onMove, onRemove, onGrab) {
    const [cx, cy] = pixel(place), dot = make("circle", { cx, cy, r: css.startsWith("edge") ? 6 : 10, class: `handle ${css}` });
    if (label) labels.push([{ x: cx + 13, y: cy + 4 }, label]);
    dot.removeShape = onRemove; // a double click is dispatched to the SVG, which has captured the pointer
    dot.onpointerdown = (event) => {
      onGrab?.();
      grab(event, place, onMove);
    };
  }

  function drawArea({ name, k, table, corners, at, top, heading: [c, s] }, height) {
    const css = { [KEEP_IN]: "fence in", [KEEP_OUT]: "fence out" }[name] ?? "solid", roof = css === "solid" ? top : height;
    const walls = table.radius && css !== "solid" ? [] : corners.map((corner, i) => [corner, corners[(i + 1) % corners.length]]);
    for (const [a, b] of walls) line([a, b, [...b, roof], [...a, roof]], "polygon", css);
    for (const z of css === "solid" ? [roof] : [0, roof]) line(corners.map((corner) => [...corner, z]), "polygon", css);
    const level = css === "solid" ? top : 0, label = table.name || { [KEEP_IN]: "keep in", [KEEP_OUT]: "keep out" }[name] || "";
    handle([...at, level], css === "solid" ? "building" : css, label, ([x, y, z]) => {
      const [dx, dy] = [x - at[0], y - at[1]];
      if (table.corners) change(name, k, { corners: corners.map(([a, b]) => rounded(a + dx, b + dy)) });
      else change(name, k, { position: rounded(x, y), ...(css === "solid" && { top: rounded(z)[0] }) });
    }, () => replace(name, k));
    if (table.size) handle([...corners[2], level], "edge building", "", ([x, y]) => {
      const [dx, dy] = [x - at[0], y - at[1]];
      change(name, k, { size: rounded(2 * Math.abs(c * dx + s * dy), 2 * Math.abs(c * dy - s * dx)).map((side) => Math.max(side, 0.2)) });
    });
    if (table.radius) handle([...corners[0], level], `edge ${css === "solid" ? "building" : css}`, "", ([x, y]) =>
      change(name, k, { radius: Math.max(0.2, rounded(Math.hypot(x - at[0], y - at[1]))[0]) }));
    const move = (i) => ([x, y]) => change(name, k, { corners: tables(name)[k].corners.with(i, rounded(x, y)) });
    table.corners?.forEach((corner, i) => {
      const between = centre([corner, corners[(i + 1) % corners.length]]);
      handle(corner, `edge corner ${css}`, "", move(i), corners.length > 3 ? () => change(name, k, { corners: corners.toSpliced(i, 1) }) : null);
      handle(between, `edge between ${css}`, "", move(i + 1), null, () => change(name, k, { corners: corners.toSpliced(i + 1, 0, between) }));
    });
  }

  function draw() {
    const { start, points, areas, wind } = shapes(), [x0, y0] = start, home = [x0, y0, 0];
    const route = points?.map(([x, y, z]) => [x0 + x, y0 + y, z]);
    const paths = route ? [] : tracks;
    const all = [home, ...(route ?? []), ...paths.flat(), ...areas.flatMap(({ corners, top }) => corners.flatMap(([x, y]) => [[x, y, 0], [x, y, top]]))];
    if (!held?.onMove) { // the view stays while something is dragged
      [ca, sa, ce, se] = [view.azimuth, view.elevation].flatMap((angle) => [Math.cos(angle), Math.sin(angle)]);
      const spans = [0, 1].map((k) => [Math.min(...all.map((place) => place[k])), Math.max(...all.map((place) => place[k]))]);
      middle = spans.map(([least, most]) => Math.round((least + most) / 2));
      reach = 1.2 * Math.max(5, ...spans.map(([least, most]) => (most - least) / 2));
      const ends = [...all, ...[-reach, reach].flatMap((a) => [-reach, reach].map((b) => [middle[0] + a, middle[1] + b, 0]))].map(flat);
      const low = [0, 1].map((k) => Math.min(...ends.map((end) => end[k]))), high = [0, 1].map((k) => Math.max(...ends.map((end) => end[k])));
      scale = view.zoom * Math.min((WIDTH - 2 * MARGIN) / (high[0] - low[0]), (HEIGHT - 2 * MARGIN) / (high[1] - low[1]));
      shift = [WIDTH / 2 - scale * (low[0] + high[0]) / 2, HEIGHT / 2 - scale * (low[1] + high[1]) / 2];
    }
    svg.replaceChildren();
    const step = 10 ** Math.floor(Math.log10(reach)), [cx, cy] = middle;
    for (let k = -Math.floor(reach / step); k <= reach / step; k++) {
      line([[cx + k * step, cy - reach], [cx + k * step, cy + reach]], "polyline", "grid-line");
      line([[cx - reach, cy + k * step], [cx + reach, cy + k * step]], "polyline", "grid-line");
    }
    make("text", { x: 8, y: HEIGHT - 8 }, `${step} m between the lines`);
    for (const [at, label] of [[[cx + reach, cy], "east"], [[cx, cy + reach], "north"]]) {
      const [x, y] = pixel(at);
      labels.push([{ x, y, "text-anchor": "middle" }, label]);
    }
    const height = Math.max(3, ...(points ?? []).map(([, , z]) => z)); // [m] of the drawn fence
    areas.forEach((area) => drawArea(area, height));
    if (route) {
      route.forEach((place) => line([place, [...place.slice(0, 2), 0]], "polyline", "drop"));
      line([home, [...start, route[0][2]], ...route], "polyline", "path");
      route.forEach((place, k) => handle(place, "waypoint", k + 1,
        ([x, y, z]) => replace(WAYPOINTS, k, [...rounded(x - x0, y - y0, z), ...points[k].slice(3)]), points.length > 1 ? () => replace(WAYPOINTS, k) : null));
    }
    paths.forEach((places) => line(places, "polyline", "path"));
    if (input(START)) handle(home, "start", "start", ([x, y]) => write(START, rounded(x, y)));
    if (wind) {
      const [u, v, w = 0] = wind.value, foot = [cx - 0.8 * reach, cy - 0.8 * reach, 0], tip = [foot[0] + WIND * u, foot[1] + WIND * v, 0];
      line([foot, tip], "polyline", "wind");
      handle(tip, "wind", `wind ${Math.hypot(u, v).toFixed(1)} m/s`,
        ([x, y]) => write(wind.name, [...rounded((x - foot[0]) / WIND, (y - foot[1]) / WIND), w]));
    }
    for (const [place, label] of labels.splice(0)) make("text", place, label);
  }

  const ground = ({ clientX, clientY }) => { // point of the ground below the mouse
    const box = svg.getBoundingClientRect(), size = WIDTH / box.width;
    const right = ((clientX - box.left) * size - shift[0]) / scale, away = -((clientY - box.top) * size - shift[1]) / scale / se;
    return [ca * right - sa * away, sa * right + ca * away];
  };
  const square = ([x, y], half) => [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => rounded(x + half * a, y + half * b));
  const TOOLS = { // label, key of the list, new item on a point of the ground
    waypoint: ["Waypoint", WAYPOINTS, ([x, y], _, { start, points }) => [...rounded(x - start[0], y - start[1]), points.at(-1)[2]]],
    building: ["Building", BOX, (at) => ({ position: rounded(...at), size: [2, 2], top: 3 })],
    tower: ["Tower", TOWER, (at) => ({ position: rounded(...at), radius: 1, top: 5 })],
    in: ["Keep-in area", KEEP_IN, (at, other, { start }) => {
      const half = Math.max(0.7 * reach, 1.3 * Math.hypot(at[0] - start[0], at[1] - start[1]));
      return other ? { position: rounded(...at), radius: rounded(half)[0] } : { corners: square(at, half) };
    }],
    out: ["Keep-out area", KEEP_OUT, (at, other) => (other ? { corners: square(at, 0.2 * reach) } : { position: rounded(...at), radius: rounded(0.2 * reach)[0] })],
  };
  const place = (name, event) => write(TOOLS[name][1], [...tables(TOOLS[name][1]), TOOLS[name][2](ground(event), event.shiftKey, shapes())]);
  const buttons = document.querySelector("#map-tools"), { points, wind } = shapes();
  const button = (label, onclick) => {
    const node = Object.assign(document.createElement("button"), { type: "button", className: "button", textContent: label, onclick });
    buttons.append(node);
    return node;
  };
  for (const [name, [label, list]] of Object.entries(TOOLS)) {
    if (name === "waypoint" ? points : input(list)) button(label, () => choose(name)).dataset.tool = name;
  }
  const add = document.querySelector("#add"), steady = "effects.wind_constant";
  if (!wind && [...add.options].some(({ value }) => value === steady)) {
    button("Wind", () => {
      add.value = steady;
      add.dispatchEvent(new Event("change", { bubbles: true }));
    });
  }
  function choose(name) { // the next click on the ground places this
    tool = tool === name ? null : name;
    for (const node of buttons.children) node.setAttribute("aria-pressed", String(tool !== null && node.dataset.tool === tool));
    svg.classList.toggle("placing", tool !== null);
  }

  svg.onpointerdown = (event) => {
    if (tool) {
      place(tool, event);
      choose(tool);
      draw();
    } else {
      grab(event);
      Object.assign(held, { azimuth: view.azimuth, elevation: view.elevation });
    }
  };
  svg.onpointermove = ({ clientX, clientY, shiftKey }) => {
    if (!held) return;
    const size = WIDTH / svg.getBoundingClientRect().width, dx = (clientX - held.from[0]) * size, dy = (clientY - held.from[1]) * size;
    held.moved ||= Math.hypot(dx, dy) > 2;
    if (!held.moved) return;
    if (!held.onMove) { // the ground turns with the mouse
      view.azimuth = held.azimuth - 0.008 * dx;
      view.elevation = Math.min(1.4, Math.max(0.12, held.elevation + 0.008 * dy));
    } else {
      const [x, y, z = 0] = held.place, right = dx / scale, down = dy / scale, away = -down / se;
      held.onMove(shiftKey ? [x, y, Math.max(0, z - down / ce)] : [x + ca * right - sa * away, y + sa * right + ca * away, z]);
    }
    draw();
  };
  svg.onpointerup = svg.onpointercancel = () => {
    const { moved } = held ?? {};
    held = null;
    if (moved) draw(); // otherwise the dot stays for a double click
  };
  svg.onwheel = (event) => {
    event.preventDefault();
    view.zoom = Math.min(8, Math.max(0.3, view.zoom * Math.exp(-0.001 * event.deltaY)));
    draw();
  };
  svg.ondblclick = (event) => { // removes what is below the mouse, or adds a waypoint to the ground at the height of the last one
    const { removeShape } = document.elementFromPoint(event.clientX, event.clientY);
    if (removeShape) removeShape();
    else if (removeShape === undefined && shapes().points) place("waypoint", event);
    draw();
  };
  form.addEventListener("input", () => held || draw());
  form.addEventListener("paths", ({ detail }) => {
    tracks = detail;
    if (!held) draw();
  });
  document.querySelector("#map-help").textContent = "Drag what you want to move; with Shift a waypoint or a roof up and down. " +
    "Drag the ground to turn the view; the wheel zooms. Choose what to place, then click the ground (with Shift an area has the other shape, circle or polygon). " +
    `Double-click a dot to remove it${points ? ", the ground to add a waypoint" : ""}.`;
  draw();
})();
