// What the pages do beyond plain forms: preview while typing, cards that load, the state of a run.
(() => {
  const all = (selector, from = document) => [...from.querySelectorAll(selector)];

  // Cards of flights: each log is read when its card comes into view.
  const near = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      near.unobserve(target);
      fetch(target.dataset.load).then(async (answer) => {
        if (answer.ok) target.outerHTML = await answer.text();
      }, () => {});
    }
  }, { rootMargin: "300px" });
  all("[data-load]").forEach((card) => near.observe(card));

  // Two to four chosen flights can be compared.
  const compare = document.querySelector("#compare");
  document.addEventListener("change", ({ target }) => {
    if (compare && target.name === "flight") {
      const count = all("input[name=flight]:checked").length;
      compare.disabled = count < 2 || count > 4;
      compare.textContent = count ? `Compare ${count} flights` : "Compare";
    }
  });

  // A flight that is dropped on another one is compared with it.
  const nameIn = (card) => card?.querySelector("input[name=flight]")?.value;
  const onCards = (kind, act) => document.addEventListener(kind, (event) => {
    const card = event.target.closest?.(".card");
    if (nameIn(card)) act(event, card);
  });
  onCards("dragstart", ({ dataTransfer }, card) => dataTransfer.setData("text/x-flight", nameIn(card)));
  onCards("dragover", (event, card) => {
    if (!event.dataTransfer.types.includes("text/x-flight")) return;
    event.preventDefault();
    card.classList.add("over");
  });
  onCards("dragleave", (_, card) => card.classList.remove("over"));
  onCards("drop", (event, card) => {
    const other = event.dataTransfer.getData("text/x-flight");
    card.classList.remove("over");
    event.preventDefault();
    if (other && other !== nameIn(card)) location = `compare?${new URLSearchParams([["flight", other], ["flight", nameIn(card)]])}`;
  });

  document.addEventListener("click", ({ target }) => {
    if (!target.matches?.(".copy")) return;
    const text = document.getElementById(target.dataset.of).textContent;
    navigator.clipboard?.writeText(text).then(() => { target.textContent = "copied"; }, () => {});
  });

  // The form: the command line, the Python and the faults of what it holds.
  const form = document.querySelector("#scene");
  if (form) {
    let timer = 0, latest = 0;
    const named = (key) => all("[data-key]", form).find((field) => field.dataset.key === key);
    const show = ({ command, python, toml, changed, faults, error, paths, warnings }) => {
      if (!error && !Object.keys(faults).length) form.dispatchEvent(new CustomEvent("paths", { detail: paths }));
      document.querySelector("#toml").textContent = toml || "# no changes";
      document.querySelector("#command").textContent = command;
      document.querySelector("#python").textContent = python;
      document.querySelector("#warnings").textContent = warnings.join("\n");
      const problem = document.querySelector("#problem");
      if (error || latest > 1) { // the first preview keeps the fault of the page
        problem.hidden = !error;
        problem.textContent = error;
      }
      for (const field of all("[data-key]", form)) {
        const fault = faults[field.dataset.key] ?? "";
        field.classList.toggle("changed", changed.includes(field.dataset.key));
        field.classList.toggle("faulty", Boolean(fault));
        field.querySelector(".fault").textContent = fault;
      }
      for (const group of all("details.group", form)) {
        const count = all(".field.changed", group).length;
        group.querySelector("summary .count").textContent = count ? ` ${count} changed` : "";
      }
      form.dataset.previewed = String(latest);
    };
    const preview = async () => {
      const number = ++latest;
      const answer = await fetch(form.dataset.preview, { method: "POST", body: new URLSearchParams(new FormData(form)) });
      if (answer.ok && number === latest) show(await answer.json());
    };
    form.addEventListener("input", ({ target }) => {
      if (target.id === "filter") return;
      clearTimeout(timer);
      timer = setTimeout(preview, 250);
    });
    document.querySelector("#add")?.addEventListener("change", async ({ target }) => {
      clearTimeout(timer);
      await preview(); // marks what was changed just now
      const changed = all(".field.changed", form).map((field) => field.querySelector("[name]"))
        .filter((input) => input.type !== "checkbox" || input.checked) // of an added effect: not switched off
        .map((input) => ["set", `${input.name}=${input.value}`]);
      const added = all("input[name=add]", form).map((input) => ["add", input.value]);
      location = `?${new URLSearchParams([...changed, ...added, ["add", target.value]])}#${target.value}`;
    });
    document.querySelector("#filter").addEventListener("input", ({ target }) => {
      const words = target.value.toLowerCase().split(/\s+/).filter(Boolean);
      for (const field of all("[data-key]", form)) {
        const text = `${field.dataset.key} ${field.textContent}`.toLowerCase();
        field.hidden = !words.every((word) => text.includes(word));
        field.style.display = field.hidden ? "none" : "";
      }
      for (const group of all("details.group", form)) {
        const some = all("[data-key]", group).some((field) => !field.hidden);
        group.style.display = words.length && !some ? "none" : "";
        group.dataset.open ??= String(group.open);
        group.open = words.length ? some : group.dataset.open === "true";
      }
    });
    preview();
  }

  // A run: its 3D view, time and output until it has ended.
  const run = document.querySelector("#run[data-state]");
  if (run) {
    const frame = document.querySelector("iframe.live"), wait = document.querySelector("#waiting");
    const bar = document.querySelector(".progress i"), time = document.querySelector("#time");
    const output = document.querySelector("#output");
    const poll = async () => {
      const state = await fetch(run.dataset.state).then((answer) => answer.json(), () => null);
      if (state && !state.running) {
        location.reload();
        return;
      }
      if (state) {
        if (state.live && frame && !frame.src) {
          frame.src = state.live;
          frame.hidden = false;
          wait.hidden = true;
        }
        if (state.time) {
          time.textContent = `${state.time.toFixed(1)} s simulated, ${state.rate.toFixed(1)} times real time`;
          bar.style.width = `${Math.min(100, (100 * state.time) / Number(run.dataset.duration))}%`;
        }
        output.textContent = state.lines.join("\n");
      }
      setTimeout(poll, 500);
    };
    poll();
  }
})();
