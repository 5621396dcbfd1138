// Camera modes, and synchronisation of the time with an enclosing page, in a page of viser's client.
(() => {
  const facts = window.lapwing;
  const looks = { darkMode: matchMedia("(prefers-color-scheme: dark)").matches };
  Object.defineProperty(window, "__VISER_EMBED_CONFIG__", { get: () => looks, set() {} }); // overrides the configuration of a recording

  const { slow, smooth, simplify } = window.lapwingSoftware;

  // The player updates its bar at 120 Hz, faster than recordings and screens.
  const every = window.setInterval;
  window.setInterval = (run, period, ...rest) => every(run, period < 10 ? 1000 / (slow ? 30 : 60) : period, ...rest);

  const view = { mode: "follow", vehicle: 0, fresh: true, time: null };
  window.lapwingView = view;
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

  function showTrails() { // shows the part of each trail up to the current time; its points have equal time steps
    if (!facts.span) return;
    const share = (view.time - facts.span[0]) / (facts.span[1] - facts.span[0]);
    facts.names.forEach((_, k) => node("trail", k)?.traverse(({ geometry }) => {
      const pieces = geometry?.attributes.instanceStart?.count;
      if (pieces) geometry.instanceCount = Math.floor(Math.min(Math.max(share, 0), 1) * pieces + 1e-6);
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
    const slider = document.querySelector("[role=slider]");
    if (slider) {
      view.shown = true;
      const time = Number(slider.getAttribute("aria-valuenow")) + facts.start;
      if (time !== view.time) {
        view.time = time;
        if (parent !== window) parent.postMessage({ lapwing: "time", time }, "*");
      }
    } else if (facts.live) view.shown = true;
  }
  function steer() {
    if (view.filming) return;
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
      for (let k = 0; k < 100 && !(Math.abs(view.time - time) < 2e-3); k++) {
        await turn();
        follow();
      }
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
