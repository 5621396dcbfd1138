// Sticks of the keyboard or a gamepad, for the vehicles of a live view that accept commands.
(() => {
  const facts = window.lapwing, view = window.lapwingView;
  if (!facts.sticks?.length) return;
  const KEYS = { // stick (forward, left, up, yaw to the left) and its deflection
    ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [1, 1], ArrowRight: [1, -1], KeyW: [2, 1], KeyS: [2, -1], KeyA: [3, 1], KeyD: [3, -1],
  };
  const COMMANDS = { KeyT: ["arm", "takeoff"], KeyL: ["land"], KeyR: ["return"], KeyP: ["position_control"] };
  const BUTTONS = ["KeyT", "KeyL", "KeyR", "KeyP"]; // A or cross, B or circle, X or square, Y or triangle
  const PERIOD = 50, FREE = 0.1; // [ms] between two messages; deflection that takes over
  const held = new Set(), pressed = new Set();
  let flown = null, flying = false, moved = false, asked = Promise.resolve(); // vehicle with sticks; whether they fly it; last message

  function send(kind, values = []) { // one after the other, so that they keep their order
    const query = new URLSearchParams({ vehicle: flown, kind, values });
    asked = asked.then(() => fetch(`sticks?${query}`)).catch(() => (flown = null)); // the flight is over
    return asked;
  }
  function command(code) {
    flown ??= facts.names[view.vehicle];
    flying = code === "KeyP";
    COMMANDS[code].forEach((kind) => send(kind));
  }
  function sticks() {
    const result = [0, 0, 0, 0], pad = [...navigator.getGamepads()].find((each) => each?.connected);
    for (const code of held) result[KEYS[code][0]] += KEYS[code][1];
    if (pad) { // mode 2: throttle and yaw on the left, pitch and roll on the right
      [3, 2, 1, 0].forEach((axis, k) => (result[k] -= pad.axes[axis] ?? 0));
      BUTTONS.forEach((code, k) => {
        const down = pad.buttons[k]?.pressed;
        if (down && !pressed.has(k)) command(code);
        pressed[down ? "add" : "delete"](k);
      });
    }
    return result.map((value) => Math.round(1e3 * Math.max(-1, Math.min(1, value))) / 1e3);
  }
  async function poll() {
    const values = sticks(), pushed = !moved && values.some((value) => Math.abs(value) > FREE), viewed = facts.names[view.vehicle];
    moved = values.some((value) => Math.abs(value) > FREE);
    if (pushed && (flying || facts.sticks.includes(viewed))) { // again at each push: on the ground the autopilot disarms
      if (!flying) flown = viewed;
      flying = true;
      send("position_control");
      send("arm");
    }
    if (flown !== null) await send("manual", values); // also centred: without sticks the vehicle returns
    setTimeout(poll, PERIOD);
  }
  const typing = ({ target, ctrlKey, metaKey, altKey }) => ctrlKey || metaKey || altKey || /^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName);
  addEventListener("keydown", (event) => {
    if (typing(event) || !(event.code in KEYS || event.code in COMMANDS)) return;
    event.stopImmediatePropagation(); // the client would move the camera
    event.preventDefault();
    if (event.code in KEYS) held.add(event.code);
    else if (!event.repeat) command(event.code);
  }, true);
  addEventListener("keyup", ({ code }) => held.delete(code), true);
  addEventListener("blur", () => held.clear());
  addEventListener("DOMContentLoaded", () => {
    const help = document.createElement("span");
    help.textContent = "T take off; arrows move; W S up, down; A D turn; L land; R return; P hover; or a gamepad";
    document.getElementById("lapwing").append(help);
    poll();
  });
})();
