// Camera modes, and synchronisation of the time with an enclosing page, in a page of viser's client.
(() => {
  const facts = window.lapwing;
  const scheme = matchMedia("(prefers-color-scheme: dark)"), looks = { darkMode: scheme.matches };
  scheme.addEventListener("change", () => (document.documentElement.dataset.mantineColorScheme = scheme.matches ? "dark" : "light")); // the client reads it once
  Object.defineProperty(window, "__VISER_EMBED_CONFIG__", { get: () => looks, set() {} }); // overrides the configuration of a recording

  const { slow, smooth, simplify } = window.lapwingSoftware;

  // The player updates its bar at 120 Hz, faster than recordings and screens.
  const every = window.setInterval;
  window.setInterval = (run, period, ...rest) => every(run, period < 10 ? 1000 / (slow ? 30 : 60) : period, ...rest);

  const view = { mode: "follow", vehicle: 0, fresh: true, time: null };
  window.lapwingView = view;

  // React draws the player's bar and other controls each time the player moves on, which takes longer than drawing the
  // scene. Its scheduler uses `setImmediate` where it exists; this one starts at most ten runs a second.
  const CONTROLS = 100; // [ms] between two runs
  const { port1: starts, port2: ends } = new MessageChannel(), runs = [], postponed = [];
  let began = 0, busy = false; // time of the last start [ms]; whether a run is in progress
  ends.onmessage = () => {
    busy = true; // a run in several parts is not interrupted
    try {
      runs.shift()();
    } finally {
      busy = false;
    }
  };
  const isDue = () => busy || !view.ready || view.filming || document.hidden || performance.now() >= began + CONTROLS;
  function drawControls() {
    if (!postponed.length || !isDue()) return;
    began = performance.now();
    for (const run of postponed.splice(0)) {
      runs.push(run);
      starts.postMessage(0);
    }
  }
  window.setImmediate = (run) => {
    postponed.push(run);
    drawControls();
  };

  const client = () => window.__viserMutable; // scene of viser's client, exposed for its tests
  const state = () => client()?.scene?.__r3f?.root.getState();

  const PARTS = { body: "0 [^/]*", label: "0 [^/]*/label", trail: "trail", reference: "reference/body", estimate: "estimate/body" };
  const names = {}, missed = {}; // names of nodes; times of failed searches [ms]
  function nameOf(part, number) { // name of a vehicle's node, which starts with the vehicle's number
    const nodes = client().nodeRefFromName, key = part + number, now = performance.now();
    if (!nodes[names[key]] && !(view.ready && now < missed[key] + 500)) { // a search scans all names
      const shape = new RegExp(`^/${number} [^/]*/${PARTS[part]}$`);
      names[key] = Object.keys(nodes).find((name) => shape.test(name));
      if (!names[key]) missed[key] = now;
    }
    return names[key];
  }
  const node = (part, number) => client().nodeRefFromName[nameOf(part, number)];
  const isPlaced = (number) => client()?.nodePoseData[nameOf("body", number)]?.poseUpdateState === "updated";
  function pose() {
    const body = node("body", view.vehicle);
    body.updateWorldMatrix(true, false);
    const m = body.matrixWorld.elements;
    return { place: [m[12], m[13], m[14]], ahead: [m[0], m[1], m[2]], up: [m[8], m[9], m[10]] };
  }

  const cut = new WeakMap(); // true end of the shortened piece of a trail: its index in the buffer and its coordinates
  function showTrails() { // shows each trail up to the current time; its last piece is shortened
    facts.trails?.forEach((times, k) => node("trail", k)?.traverse(({ geometry }) => {
      if (!geometry?.attributes.instanceEnd) return;
      const { instanceStart: { offset: first }, instanceEnd: { data, offset } } = geometry.attributes, { array, stride } = data;
      const change = (at, values) => {
        array.set(values, at);
        data.addUpdateRange(at, 3);
        data.needsUpdate = true;
      };
      if (cut.has(geometry)) change(...cut.get(geometry));
      cut.delete(geometry);
      const next = times.findIndex((time) => time > view.time), whole = (next < 0 ? times.length : next) - 1;
      geometry.instanceCount = Math.max(whole, 0);
      if (whole < 0 || next < 0) return;
      const share = (view.time - times[whole]) / (times[next] - times[whole]), at = whole * stride;
      const start = array.slice(at + first, at + first + 3), end = array.slice(at + offset, at + offset + 3);
      if (share <= 0) return;
      cut.set(geometry, [at + offset, end]);
      change(at + offset, start.map((value, i) => value + share * (end[i] - value)));
      geometry.instanceCount += 1;
    }));
  }

  function thinGhosts() { // keeps faint ghosts from hiding translucent parts of the vehicle behind them
    facts.names.forEach((_, k) => ["reference", "estimate"].forEach((part) => node(part, k)?.traverse(({ material }) => {
      if (material) material.depthWrite = false;
    })));
  }

  function showNames({ camera, size }) { // shows the labels that no nearer label covers
    const tree = window.__viserSceneTree?.getState(), boxes = [];
    const labels = facts.names.map((text, k) => {
      const name = nameOf("label", k), body = node("body", k), place = client().nodePoseData[name]?.position;
      if (!body || !place || !tree?.[name]) return null;
      const at = camera.position.clone().set(...place).applyMatrix4(body.matrixWorld), distance = at.distanceTo(camera.position);
      at.project(camera);
      const x = (0.5 + 0.5 * at.x) * size.width, y = (0.5 - 0.5 * at.y) * size.height;
      return { entry: tree[name], distance, left: x, top: y, right: x + 6 * text.length + 8, bottom: y + 18 };
    });
    for (const { entry, distance, ...box } of labels.filter(Boolean).sort((a, b) => a.distance - b.distance)) {
      const free = boxes.every((b) => box.right < b.left || b.right < box.left || box.bottom < b.top || b.bottom < box.top);
      if (free) boxes.push(box);
      entry.effectiveVisibility = free;
    }
  }

  function barTime() { // time of the player's bar [s]; null without a player
    const slider = document.querySelector("[role=slider]");
    return slider && Number(slider.getAttribute("aria-valuenow")) + facts.start;
  }
  function timeNow() { // time of the bar, or of the scene if the bar is not up to date
    const bar = barTime(), clock = client()?.nodePoseData["/clock"];
    if (clock?.poseUpdateState !== "updated") return view.time ?? bar;
    const scene = clock.position[0] + facts.start;
    return scene <= bar && bar < scene + facts.step ? bar : scene;
  }

  let drawn = "", placed = "", changed = 0; // keys of the last drawn and placed state, time of the last change [ms]
  function follow() {
    const now = state();
    const bodies = now?.controls ? facts.names.map((_, k) => node("body", k)) : [null];
    const at = facts.names.every((_, k) => bodies[k]?.parent && (isPlaced(k) || !view.fresh)) && pose();
    if (at) {
      const next = `${view.time},${now.camera.matrixWorld.elements}`, elsewhere = `${view.mode},${at.place},${at.ahead},${at.up}`;
      if (next !== drawn) {
        changed = performance.now();
        showTrails();
        thinGhosts();
        showNames(now);
        view.changed?.();
      }
      drawn = next;
      if (slow) simplify(now, at, view.filming);
      if (slow && !smooth && !view.filming) { // a quarter of the pixels during motion
        const ratio = devicePixelRatio * (performance.now() - changed < 1500 ? 0.5 : 1);
        if (now.viewport.dpr !== ratio) now.setDpr(ratio);
      }
      const { controls } = now, [x, y, z] = at.place, size = Math.max(0.5, facts.size);
      if (view.fresh || elsewhere !== placed) {
        if (view.mode === "onboard") {
          const [a, b, c] = at.ahead, [u, v, w] = at.up, up = 0.35 * size, back = 0.9 * size;
          controls.setLookAt(x + up * u - back * a, y + up * v - back * b, z + up * w - back * c, x + 20 * a, y + 20 * b, z + 20 * c, false);
        } else if (view.fresh) { // far enough for a fleet to be in view
          const spread = Math.max(...bodies.map((other) => other.position.distanceTo(bodies[view.vehicle].position)));
          const far = view.place ? size : Math.max(size, Math.min(0.6 * spread, 5 * size));
          const usual = view.mode === "top" ? [0, 14, 0.01] : [1.5, 0.75, 1.9];
          const [dx, dy, dz] = (view.place ?? usual).map((value) => value * far);
          controls.setLookAt(x + dx, y + dy, z + dz, x, y, z, false);
        } else if (view.mode !== "orbit") controls.moveTo(x, y, z, false);
        now.invalidate();
      }
      placed = elsewhere;
      view.fresh = false;
      if (view.shown) view.ready = true;
    }
    if (barTime() !== null) {
      view.shown = true;
      const time = timeNow();
      if (time !== view.time) {
        view.time = time;
        if (parent !== window) parent.postMessage({ lapwing: "time", time }, "*");
      }
    } else if (facts.live) view.shown = true;
  }
  function steer() {
    if (view.filming) return;
    drawControls();
    follow();
    requestAnimationFrame(steer);
  }

  view.seek = (time) => { // through the number field of the player
    const field = document.querySelector("input:not([type=checkbox])");
    if (!field) return;
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(field, String(Math.max(0, time - facts.start)));
    field.dispatchEvent(new Event("input", { bubbles: true }));
  };
  addEventListener("message", ({ data, source }) => {
    if (source === parent && data?.lapwing === "seek") view.seek(Number(data.time));
  });

  view.camera = () => { // position and target in three.js axes, y up
    const { camera, controls } = state(), { x, y, z } = controls.getTarget(camera.position.clone());
    return { place: camera.position.toArray(), target: [x, y, z] };
  };
  view.redraw = () => state().invalidate();
  view.frames = () => state().gl.info.render.frame; // number of drawn frames
  view.look = (mode, vehicle = view.vehicle, place = null) => Object.assign(view, { mode, vehicle, place, fresh: true });
  const { port1: requests, port2: replies } = new MessageChannel(), waiting = [];
  replies.onmessage = () => waiting.shift()();
  const turn = () => new Promise((done) => { // yields to the event loop, without the 4 ms of a timer
    waiting.push(done);
    requests.postMessage(0);
  });
  view.film = async (times, kind, quality) => { // images at times [s], as data URLs; the page is frozen from now on
    const now = state(), canvas = now.gl.domElement, { render } = now.gl, pictures = [];
    if (!view.filming) {
      view.filming = true;
      drawControls();
      now.setFrameloop("never");
      document.getElementById("lapwing").remove();
      canvas.style.visibility = "hidden"; // no compositing needed
      view.seek(facts.start + 1e6); // stops the player, even if it is already at the first time
      await turn();
    }
    const pass = (isDrawn) => {
      now.gl.render = isDrawn ? render : () => {};
      state().advance(performance.now() / 1000);
    };
    for (const time of times) {
      view.seek(time);
      for (let k = 0; k < 100 && !(Math.abs(barTime() - time) < 2e-3); k++) await turn();
      pass(false); // viser processes the messages of this time
      await turn(); // its page updates its state
      pass(false); // moves the bodies
      if (canvas.width !== innerWidth || canvas.height !== innerHeight) { // due to a play bar or to viser's lower resolution
        now.setDpr(1);
        now.setSize(innerWidth, innerHeight);
      }
      follow();
      pass(true);
      pictures.push(canvas.toDataURL(kind, quality)); // toBlob would wait for an idle page
    }
    return pictures;
  };

  requestAnimationFrame(steer);
})();
