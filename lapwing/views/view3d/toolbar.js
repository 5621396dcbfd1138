// Camera, vehicle and layers of the 3D view, and its legend.
(() => {
  const facts = window.lapwing, view = window.lapwingView;

  // Layers that can be hidden: patterns of node names, hidden as in viser's panel.
  const LAYERS = { reference: "reference", estimate: "estimate", sensors: "(sonar|rangefinder|lidar|depth_camera)", wind: "wind" };
  const TINTS = { reference: "#4a5560", estimate: "#cc79a7", sensors: "#e69f00", wind: "#56b4e9" };
  const hidden = new Set(); // names of layers
  function nodesOf(layer) {
    const shape = new RegExp(`^/\\d+ [^/]*/([^/]*/)?${LAYERS[layer]}$`), tree = window.__viserSceneTree?.getState() ?? {};
    return Object.keys(tree).filter((name) => shape.test(name)).map((name) => tree[name]);
  }
  view.changed = () => { // a live scene may have new nodes
    for (const layer of hidden) for (const node of nodesOf(layer)) node.overrideVisibility = false;
  };
  view.show = (layer, shown) => {
    hidden[shown ? "delete" : "add"](layer);
    for (const node of nodesOf(layer)) node.overrideVisibility = shown ? undefined : false;
    view.redraw();
  };
  function dot(colour) {
    const result = document.createElement("u");
    result.style.background = colour;
    return result;
  }
  function layerBoxes() {
    const menu = document.createElement("details"), title = document.createElement("summary");
    title.textContent = "layers";
    const boxes = Object.keys(LAYERS).map((layer) => {
      const row = document.createElement("label"), box = Object.assign(document.createElement("input"), { type: "checkbox", checked: true, name: layer });
      box.onchange = () => view.show(layer, box.checked);
      row.append(box, dot(TINTS[layer]), layer);
      return row;
    });
    menu.ontoggle = () => boxes.forEach((row) => (row.hidden = !nodesOf(row.textContent).length));
    menu.append(title, ...boxes);
    return menu;
  }

  function select(name, options, onSelect) {
    const box = document.createElement("select");
    box.name = name;
    box.title = name;
    options.forEach((text, k) => box.add(new Option(text, k)));
    box.onchange = () => onSelect(Number(box.value));
    return box;
  }
  addEventListener("DOMContentLoaded", () => {
    const style = document.createElement("style");
    style.textContent = `.mantine-Notifications-root { display: none }
      .mantine-Input-input:disabled { opacity: 1 !important; color: inherit !important; background: none !important; border: 0; cursor: auto }
      .mantine-Flex-root:has(> div > .mantine-Textarea-root) { display: block !important } /* the events below their label */
      textarea.mantine-Textarea-input:disabled { min-height: 55vh; max-height: none; font-variant-numeric: tabular-nums }
      #lapwing { position: fixed; top: 10px; left: 10px; max-width: calc(100% - 20px); box-sizing: border-box; z-index: 5; display: flex; flex-wrap: wrap; gap: 8px; align-items: center;
        font: 13px system-ui, sans-serif; color: #1f2328; background: #ffffffd9; border-radius: 6px; padding: 6px 10px }
      #lapwing span { display: flex; gap: 6px; align-items: center }
      #lapwing select { font: inherit; border: 1px solid #d0d7de; border-radius: 4px; background: #fff; color: inherit; padding: 2px 4px }
      #lapwing details { position: relative }
      #lapwing summary { cursor: pointer }
      #lapwing label { display: flex; gap: 4px; align-items: center }
      #lapwing label[hidden] { display: none }
      #lapwing i { display: inline-block; width: 90px; height: 8px; border-radius: 4px;
        background: linear-gradient(90deg, #004c8c, #008eaa, #56b46e, #deba28, #e06e14) }
      #lapwing u { text-decoration: none; display: inline-block; width: 10px; height: 10px; border-radius: 5px }
      @media (min-width: 601px) { #lapwing.live { max-width: calc(100% - 350px) } } /* beside the panel */
      @media (max-width: 600px) {
        .mantine-Paper-root { max-height: 35% !important; max-width: 100% }
        textarea.mantine-Textarea-input:disabled { min-height: 12vh }
      }
      @media (prefers-color-scheme: dark) {
        #lapwing { color: #e6eaee; background: #14181dd9 }
        #lapwing select { background: #1d232a; border-color: #39424c }
      }`;
    document.head.append(style);
    const bar = document.createElement("div");
    bar.id = "lapwing";
    bar.className = facts.live ? "live" : "";
    const label = (...parts) => bar.appendChild(document.createElement("span")).append(...parts);
    const modes = ["follow", "orbit", "top", "onboard"];
    bar.append(select("camera", modes, (k) => view.look(modes[k])));
    if (facts.names.length > 1) {
      bar.append(select("vehicle", facts.names, (k) => view.look(view.mode, k)));
      facts.names.forEach((name, k) => label(dot(facts.colours[k]), name));
    }
    bar.append(layerBoxes());
    if (facts.error > 0) {
      const unit = facts.error < 0.1 ? [1000, "mm"] : [1, "m"];
      label("error 0", document.createElement("i"), `${Number((facts.error * unit[0]).toPrecision(2))} ${unit[1]}`);
    }
    document.body.append(bar);
  });
})();
