// The vehicle flies again: bodies drawn as lines in space at a time that a slider, a clock or the plots' cursor gives.
// While the flight goes on, `section.dataset.stream` names where its rows come from (server-sent events).
const fly = (section, given, live) => {
  const box = section.querySelector(".space");
  const [slider, play, speed, follow, whom, forces, label] = ["time", "play", "speed", "follow", "whom", "forces", "now"].map(
    (name) => section.querySelector(`[name=${name}]`),
  );
  const FORCE = 0.02, WIND = 0.15; // m for 1 N, m for 1 m/s
  const RING = 24, HALF = 0.5, LAG = 0.3; // how far a flight that goes on is shown behind [s]
  const NAMED = 8; // vehicles at most that are told apart by their colours

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
  const floats = (text) => text && new Float32Array(bytes(text));
  const decode = (flight) => ({
    ...flight,
    t: new Float64Array(bytes(flight.t)),
    path: floats(flight.path),
    asked: floats(flight.asked),
    wind: floats(flight.wind),
    contact: flight.contact && { ...flight.contact, p: floats(flight.contact.p), f: floats(flight.contact.f) },
    bodies: flight.bodies.map((body) => ({
      ...body,
      p: floats(body.p),
      q: floats(body.q),
      f: floats(body.f),
      surface: body.surface && { points: floats(body.surface[0]), faces: new Uint16Array(bytes(body.surface[1])), colour: body.surface[2] },
      strokes: body.strokes.map(([points, colour, width]) => ({ points: floats(points), colour, width })),
      rotors: body.rotors.map(([hub, radius, angle]) => ({ hub: floats(hub), radius, angle: floats(angle) })),
    })),
  });
  const flights = given.flights.map(decode);
  const KEPT = Math.max(300, 6000 / flights.length); // rows of a flight that goes on

  // More rows of a flight that goes on, without the first, which is known; the oldest go where there are too many.
  function extend(known, more) {
    const join = (name, width, a, b) => {
      if (!a[name]) return;
      const rows = b[name] ? b[name].subarray(width) : new a[name].constructor(width * (more.t.length - 1)), kept = a[name].subarray(Math.max(0, a[name].length - width * KEPT));
      const joined = new a[name].constructor(kept.length + rows.length);
      joined.set(kept);
      joined.set(rows, kept.length);
      a[name] = joined;
    };
    join("t", 1, known, more);
    ["path", "asked", "wind"].forEach((name) => join(name, 3, known, more));
    if (known.contact) ["p", "f"].forEach((name) => join(name, 3 * known.contact.points, known.contact, more.contact));
    known.bodies.forEach((body, k) => {
      join("p", 3, body, more.bodies[k]);
      join("q", 4, body, more.bodies[k]);
      join("f", 3, body, more.bodies[k]);
      body.rotors.forEach((rotor, i) => {
        const turned = more.bodies[k].rotors[i];
        if (rotor.angle) turned.angle.forEach((angle, row) => { turned.angle[row] = angle + rotor.angle.at(-1); });
        join("angle", 1, rotor, turned);
      });
    });
  }

  // Row before a time, and how far it is on the way to the next.
  function place(times, now) {
    let low = 0, high = times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= now) low = middle; else high = middle;
    }
    const span = times[high] - times[low];
    return [low, high, span > 0 ? Math.min(1, Math.max(0, (now - times[low]) / span)) : 0];
  }

  function between(values, width, [low, high, part]) {
    const found = [];
    for (let i = 0; i < width; i++) found.push((1 - part) * values[width * low + i] + part * values[width * high + i]);
    return found;
  }

  // Unit quaternion x, y, z, w between two, the shorter way round.
  function attitude(q, [low, high, part]) {
    let same = 0;
    for (let i = 0; i < 4; i++) same += q[4 * low + i] * q[4 * high + i];
    const sign = same < 0 ? -1 : 1, found = [];
    for (let i = 0; i < 4; i++) found.push((1 - part) * q[4 * low + i] + sign * part * q[4 * high + i]);
    const norm = Math.hypot(...found) || 1;
    return found.map((value) => value / norm);
  }

  // A point of the body's frame in the world.
  function moved([x, y, z, w], p, a, b, c) {
    const u = 2 * (y * c - z * b), v = 2 * (z * a - x * c), n = 2 * (x * b - y * a);
    return [p[0] + a + w * u + y * n - z * v, p[1] + b + w * v + z * u - x * n, p[2] + c + w * n + x * v - y * u];
  }

  function line(colour, width, name) {
    const hidden = { hoverinfo: "skip", showlegend: Boolean(name), name: name || "" };
    return { type: "scatter3d", mode: "lines", x: [], y: [], z: [], line: { color: colour, width }, ...hidden };
  }

  // Points with a gap behind them.
  const append = (trace, points) => {
    for (const point of [...points, [null, null, null]]) ["x", "y", "z"].forEach((axis, i) => trace[axis].push(point[i]));
  };
  const rows = (values) => Array.from({ length: values.length / 3 }, (_, k) => values.subarray(3 * k, 3 * k + 3));

  // Traces that stay, then those that move: one for what looks the same, of all flights.
  const traces = [], moving = [];
  function add(kind, key, flight, trace) {
    const { color, width } = trace.line || {};
    const alike = (other) => trace.line && other.kind === kind && other.key === key && other.trace.line.color === color && other.trace.line.width === width;
    const found = moving.find(alike);
    if (found) found.flights.push(flight); else moving.push({ kind, key, flights: [flight], trace });
  }
  for (const flight of flights) {
    const flown = flights.length > 1 && flights.length <= NAMED ? `${flight.name}, flown` : "flown";
    add("path", "path", flight, line(flight.colour, 2, flown));
    const reference = line("#333333", 2, "reference");
    if (flight.asked) add("path", "asked", flight, { ...reference, line: { ...reference.line, dash: "dash" } });
  }
  moving.forEach(({ trace }, k) => { trace.showlegend = moving.findIndex((other) => other.trace.name === trace.name) === k; });
  if (!live) for (const { flights, key, trace } of moving.splice(0)) {
    flights.forEach((flight) => append(trace, rows(flight[key])));
    traces.push(trace);
  }
  const looks = (flight) => {
    const found = new Map();
    flight.bodies.forEach((body) => body.strokes.forEach(({ colour, width }) => found.set(`${colour} ${width}`, [colour, width])));
    return [...found];
  };
  const hull = ({ faces, colour }) => {
    const corners = [0, 1, 2].map((corner) => Array.from({ length: faces.length / 3 }, (_, k) => faces[3 * k + corner]));
    const [i, j, k] = corners;
    const lighting = { ambient: 0.5, diffuse: 0.8, facenormalsepsilon: 0, vertexnormalsepsilon: 0 }; // triangles are small
    return { type: "mesh3d", x: [], y: [], z: [], i, j, k, color: colour, flatshading: true, lighting, hoverinfo: "skip" };
  };
  for (const flight of flights) {
    flight.bodies.forEach(({ surface }, key) => { if (surface) add("surface", key, flight, hull(surface)); });
    for (const [key, [colour, width]] of looks(flight)) add("stroke", key, flight, line(colour, width));
    add("rotor", "", flight, line(flight.colour, 3));
    if (flight.links.length) add("link", "", flight, line("#9AA5AF", 3));
    if (flight.asked) add("asked", "", flight, { ...line("#333333", 2, "setpoint"), mode: "markers", marker: { size: 4, symbol: "diamond-open", color: "#333333" } });
    if (flight.wind) add("wind", "", flight, line("#56B4E9", 5, "wind"));
    if (flight.contact || flight.bodies.some((body) => body.f)) add("force", "", flight, line("#CC79A7", 4, "force of contact or joint"));
    whom.add(new Option(flight.name, whom.length));
  }
  whom.hidden = flights.length < 2;
  forces.parentElement.hidden = !moving.some(({ kind }) => kind === "force");

  function arrow(draw, from, vector) {
    const length = Math.hypot(...vector);
    if (length < 1e-6) return;
    const tip = from.map((value, i) => value + vector[i]);
    const across = Math.abs(vector[2]) < 0.9 * length ? [-vector[1], vector[0], 0] : [0, -vector[2], vector[1]];
    const scale = (0.12 * length) / (Math.hypot(...across) || 1);
    const barb = (sign) => tip.map((value, i) => value - 0.25 * vector[i] + sign * scale * across[i]);
    draw([from, tip, barb(1), tip, barb(-1)]);
  }

  // A cable of this length from one point to another: straight where it is not longer, else a parabola of about its
  // length, which hangs down, or to the side where one point is above the other.
  function hanging(from, to, length) {
    const chord = to.map((value, i) => value - from[i]), distance = Math.hypot(...chord);
    if (length <= distance) return [from, to];
    const down = [0.3, 0, -1], along = chord.map((value) => value / (distance || 1));
    const share = down.reduce((sum, value, i) => sum + value * along[i], 0);
    const across = down.map((value, i) => value - share * along[i]), norm = Math.hypot(...across) || 1;
    const sag = Math.sqrt((3 / 16) * (length * length - distance * distance)) / norm;
    return Array.from({ length: RING + 1 }, (_, k) => {
      const part = k / RING, bow = 4 * part * (1 - part) * sag;
      return from.map((value, i) => value + part * chord[i] + bow * across[i]);
    });
  }

  // Points of everything that moves at a time, by trace.
  function frame(now) {
    const found = moving.map(() => ({ x: [], y: [], z: [] }));
    moving.forEach(({ flights, kind, key }, k) => flights.forEach((flight) => {
      const at = place(flight.t, now), draw = (points) => append(found[k], points);
      if (kind === "path") return draw(rows(flight[key]));
      if (kind === "asked") return draw([between(flight.asked, 3, at)]);
      if (kind === "wind") {
        const wind = between(flight.wind, 3, at).map((value) => value * WIND);
        return arrow(draw, between(flight.path, 3, at).map((value, i) => value - wind[i] + (i === 2 ? size : 0)), wind);
      }
      if (kind === "surface") {
        const { p, q, surface: { points } } = flight.bodies[key], turned = attitude(q, at), place = between(p, 3, at);
        for (let i = 0; i < points.length; i += 3) {
          const [x, y, z] = moved(turned, place, points[i], points[i + 1], points[i + 2]);
          found[k].x.push(x), found[k].y.push(y), found[k].z.push(z);
        }
        return;
      }
      if (kind === "force" && flight.contact && forces.checked) {
        const { points, p, f } = flight.contact, feet = between(p, 3 * points, at), pushes = between(f, 3 * points, at);
        for (let i = 0; i < 3 * points; i += 3) arrow(draw, feet.slice(i, i + 3), pushes.slice(i, i + 3).map((value) => value * FORCE));
      }
      const places = flight.bodies.map((body) => [attitude(body.q, at), between(body.p, 3, at)]);
      if (kind === "link") return flight.links.forEach(([a, b, fastened, length]) => {
        const force = flight.bodies[b].f, pulls = force && Math.hypot(...between(force, 3, at)) > 0;
        draw(hanging(moved(...places[a], ...fastened), places[b][1], pulls ? 0 : length));
      });
      flight.bodies.forEach((body, index) => {
        const [q, p] = places[index];
        if (kind === "force" && body.f && forces.checked) arrow(draw, p, between(body.f, 3, at).map((value) => value * FORCE));
        if (kind === "stroke") {
          for (const { points, colour, width } of body.strokes) {
            if (`${colour} ${width}` !== key) continue;
            draw(Array.from({ length: points.length / 3 }, (_, i) => moved(q, p, ...points.subarray(3 * i, 3 * i + 3))));
          }
        }
        if (kind === "rotor") {
          for (const { hub, radius, angle } of body.rotors) {
            const turn = angle ? angle[at[0]] : 0;
            const rim = (a, r) => moved(q, p, hub[0] + r * Math.cos(a), hub[1] + r * Math.sin(a), hub[2]);
            draw(Array.from({ length: RING + 1 }, (_, i) => rim((2 * Math.PI * i) / RING, radius)));
            draw([rim(turn, radius), rim(turn + Math.PI, radius)]);
          }
        }
      });
    }));
    return found;
  }

  // The cube that holds everything, and how large a vehicle is.
  let size = 0.1, half, middle;
  function measure() {
    const corner = [Infinity, Infinity, Infinity], end = [-Infinity, -Infinity, -Infinity];
    for (const { path, bodies, links } of flights) {
      for (const values of [path, ...bodies.map((body) => body.p)]) {
        values.forEach((value, k) => {
          corner[k % 3] = Math.min(corner[k % 3], value);
          end[k % 3] = Math.max(end[k % 3], value);
        });
      }
      for (const body of bodies) {
        body.strokes.forEach(({ points }) => points.forEach((value) => { size = Math.max(size, Math.abs(value)); }));
        if (body.surface) body.surface.points.forEach((value) => { size = Math.max(size, Math.abs(value)); });
        body.rotors.forEach(({ hub, radius }) => { size = Math.max(size, Math.abs(hub[0]) + radius); });
      }
      const apart = bodies.length > 1 ? Math.max(...bodies.map((b) => Math.hypot(b.p[0] - path[0], b.p[1] - path[1], b.p[2] - path[2]))) : 0;
      size = Math.max(size, Math.min(apart, 5), ...links.map(([, , , length]) => length / 2));
    }
    half = Math.max(HALF * Math.max(...corner.map((low, i) => end[i] - low)), 1.5 * size) * 1.1;
    middle = corner.map((low, i) => (low + end[i]) / 2);
  }
  measure();

  // Ranges of the axes: all of it, or what is near the chosen vehicle.
  function ranges(now) {
    const { path, t } = flights[whom.value];
    const [centre, reach] = follow.checked ? [between(path, 3, place(t, now)), Math.min(2.5 * size, half)] : [middle, half];
    return Object.fromEntries(["x", "y", "z"].map((axis, i) => [`scene.${axis}axis.range`, [centre[i] - reach, centre[i] + reach]]));
  }

  let now = live ? given.end : 0, drawn = false, wanted = false, playing = false, before = 0, told = 0;
  async function show(tell) {
    slider.value = now;
    label.textContent = `${now.toFixed(given.end > 1000 ? 0 : 2)} s`;
    if (tell && performance.now() - told > 100) {
      told = performance.now();
      document.dispatchEvent(new CustomEvent("motion-time", { detail: now }));
    }
    if (!drawn) { wanted = true; return; }
    const at = frame(now), axes = ["x", "y", "z"];
    const data = Object.fromEntries(axes.map((axis) => [axis, at.map((trace) => trace[axis])]));
    drawn = false; // one picture after the other
    await Plotly.update(box, data, ranges(now), moving.map((_, k) => traces.length + k));
    drawn = true;
    section.dataset.time = now;
    if (wanted) { wanted = false; show(false); }
  }

  function tick(instant) {
    if (!playing) return;
    const passed = (instant - before) / 1000;
    now += live ? (given.end - now) * Math.min(1, passed / LAG) : passed * Number(speed.value);
    before = instant;
    if (!live && now >= given.end) { now = given.end; toggle(); }
    show(true);
    requestAnimationFrame(tick);
  }

  function toggle() {
    playing = !playing;
    play.textContent = playing ? "Pause" : "Play";
    if (!playing) return;
    if (!live && now >= given.end) now = 0;
    before = performance.now();
    requestAnimationFrame(tick);
  }

  for (const factor of [0.1, 0.25, 1, 4, 16, 100, 1000]) speed.add(new Option(`${factor}\u00d7`, factor));
  speed.value = [1, 4, 16, 100, 1000].find((factor) => given.end / factor <= 120) || 1000;
  function stretch() {
    slider.min = flights[0].t[0];
    slider.max = given.end;
    slider.step = given.end / 5000;
  }
  stretch();
  slider.addEventListener("input", () => { if (live && playing) toggle(); now = Number(slider.value); show(true); });
  play.addEventListener("click", toggle);
  [follow, whom, forces].forEach((choice) => choice.addEventListener("change", () => show(false)));
  document.addEventListener("plot-time", ({ detail }) => { if (!playing) { now = Math.min(given.end, Math.max(0, detail)); show(false); } });

  const axis = (title) => ({ title: { text: title }, backgroundcolor: "white", gridcolor: "#D9DDE1", showspikes: false });
  const layout = {
    height: 520,
    margin: { l: 0, r: 0, t: 0, b: 0 },
    legend: { orientation: "h", x: 0, y: 1 },
    uirevision: "the reader's camera stays",
    scene: { xaxis: axis("x east [m]"), yaxis: axis("y north [m]"), zaxis: axis("z up [m]"), aspectmode: "cube", camera: { eye: { x: -1.1, y: -1.3, z: 0.6 } } },
  };
  const near = new IntersectionObserver(async (entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    near.disconnect();
    await library;
    await Plotly.newPlot(box, [...traces, ...moving.map(({ trace }) => trace)], layout, { responsive: true, displaylogo: false });
    drawn = true;
    show(false);
  }, { rootMargin: "600px" });
  near.observe(section);

  if (live) toggle();
  return {
    more(next) {
      next.flights.map(decode).forEach((flight, k) => extend(flights[k], flight));
      given.end = next.end;
      measure();
      stretch();
    },
    end() {
      if (playing) toggle();
      live = false;
      now = given.end;
      show(false);
    },
  };
};

(() => {
  const section = document.getElementById("motion");
  if (!section) return;
  if (!section.dataset.stream) return fly(section, JSON.parse(section.querySelector("script").textContent), false);
  const state = document.getElementById("state"), source = new EventSource(section.dataset.stream);
  let flight = null;
  source.addEventListener("message", ({ data }) => {
    const next = JSON.parse(data);
    if (flight) flight.more(next); else flight = fly(section, next, true);
    for (const [time, vehicle, kind, text] of next.events) {
      const row = document.querySelector(".events tbody").insertRow(0);
      [time.toFixed(2), ...(next.flights.length > 1 ? [vehicle] : []), kind, text].forEach((value) => { row.insertCell().textContent = value; });
    }
    state.textContent = "flying";
  });
  const over = (why) => {
    source.close();
    if (flight) flight.end();
    state.textContent = why;
  };
  source.addEventListener("over", () => over("the flight is over"));
  source.addEventListener("error", () => over("the run does not answer any more"));
})();
