// The studio's page: asks for news, shows them, and sends what the user wishes.
"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const make = (tag, className, text) => {
    const made = document.createElement(tag);
    if (className) made.className = className;
    if (text !== undefined) made.textContent = text;
    return made;
  };
  const two = (x) => (x >= 100 ? x.toPrecision(3).replace(/e\+/, "·10^") : x.toFixed(2));

  // The token stands in the fragment, which never leaves the browser; then it goes from sight.
  const given = location.hash.slice(1);
  if (/^[0-9a-f]{48}$/.test(given)) {
    sessionStorage.setItem("token", given);
    history.replaceState(null, "", location.pathname);
  }
  const token = sessionStorage.getItem("token") ?? "";
  const ask = (path, body) => fetch(path, {
    method: body === undefined ? "GET" : "POST",
    headers: { "x-leverrier-token": token, ...(body === undefined ? {} : { "content-type": "application/json" }) },
    body: body === undefined ? undefined : JSON.stringify(body),
    cache: "no-store",
  });
  const why = async (answer) => answer.json().catch(() => ({ message: `the studio answered ${answer.status}` }));

  const state = { spec: null, job: null, missing: null, ledger: null, busy: false };

  const say = ({ text, message, hint, failed }) => {
    const box = $("message");
    const close = make("button", "plain", "Close");
    close.type = "button";
    close.addEventListener("click", () => { box.hidden = true; });
    const words = text ?? message ?? "";
    // Names of files and effects stay as they are.
    const named = /^\S*[._(]\S/.test(words);
    box.replaceChildren(close, make("span", "", named ? words : words.charAt(0).toUpperCase() + words.slice(1)));
    if (hint) box.append(make("span", "hint", ` (${hint})`));
    box.classList.toggle("failed", Boolean(failed));
    box.hidden = false;
  };

  // ---- wishes
  const wish = async (what) => {
    if (state.busy) return;
    state.busy = true;
    arm();
    const answer = await ask("/api/do", what).catch(() => null);
    if (!answer || !answer.ok) {
      state.busy = false;
      arm();
      say({ ...(answer ? await why(answer) : { message: "the studio does not answer" }), failed: true });
    }
  };
  const dirty = () => state.spec !== null && editor.text !== state.spec.text;
  const arm = () => {
    const busy = state.busy;
    for (const button of document.querySelectorAll("[data-wish]")) button.disabled = busy;
    $("learn").disabled = busy || editor.wrong || !state.spec;
    $("save").disabled = busy || !dirty();
    $("reload").disabled = !dirty();
    $("learn").textContent = dirty() ? "Save and learn" : "Learn";
    $("saved").textContent = !state.spec ? "" : dirty()
      ? "Not saved." : "As it is in the file.";
    const undo = state.ledger?.undo;
    $("undo").disabled = busy || !undo;
    $("undo").title = undo ? `Undo: ${undo}` : "There is nothing to undo";
    $("undo").setAttribute("aria-label", undo ? `Undo: ${undo}` : "Undo");
    document.body.classList.toggle("stale", busy);
  };
  const save = (learn) => {
    if (!state.spec || (learn && editor.wrong)) return;
    if (!dirty()) { if (learn) wish({ do: "learn" }); return; }
    wish({ do: "save", text: editor.text, base: state.spec.hash, learn });
  };
  const guarded = (act) => {
    if (dirty() && !confirm("The spec has changes that are not saved. Go on without them?")) return;
    if (dirty()) editor.text = state.spec.text;
    act();
  };
  const add = (effect) => guarded(() => wish({ do: "add", effect }));
  const undo = () => {
    if (!state.ledger?.undo || state.busy) return;
    const force = state.ledger.edited;
    const text = "The spec was edited by hand since. Undo the step before? The edits stay in the ledger.";
    if (force && !confirm(text)) return;
    guarded(() => wish({ do: "undo", force }));
  };

  // ---- the spec
  const check = async (text) => {
    const answer = await ask("/api/check", { text }).catch(() => null);
    return answer?.ok ? (await answer.json()).diagnostics : null;
  };
  const editor = leverrierEditor(check, () => arm());
  const showSpec = (spec) => {
    const old = state.spec;
    const clean = old === null || editor.text === old.text || editor.text === spec.text;
    // What was being saved is in the file now; what was typed meanwhile stays.
    state.spec = spec;
    if (clean) {
      if (editor.text !== spec.text) editor.text = spec.text;
    } else if (old.hash !== spec.hash) {
      say({ text: "The file was changed by another program. Reload shows it; Save keeps what stands here.", failed: true });
    }
    $("file").textContent = spec.name;
    const formats = $("formats");
    if (!formats.childElementCount) {
      for (const [name, path] of [...spec.formats.map((name) => [name, `/api/export?to=${name}`]), ["report (HTML)", "/api/report"],
        ["all plots (SVG)", "/api/plots?as=svg"], ["all plots (PNG)", "/api/plots?as=png"]]) {
        const button = make("button", "", name);
        button.type = "button";
        button.addEventListener("click", () => fetchFile(name, path));
        formats.append(button);
      }
    }
  };
  const fetchFile = async (name, path) => {
    $("export").open = false;
    // Pictures in pixels look as the page does.
    const dark = path.includes("as=png") && matchMedia("(prefers-color-scheme: dark)").matches;
    const answer = await ask(path + (dark ? "&paper=dark" : "")).catch(() => null);
    if (!answer?.ok) {
      say({ ...(answer ? await why(answer) : { message: "the studio does not answer" }), failed: true });
      return;
    }
    const file = /filename="([^"]+)"/.exec(answer.headers.get("content-disposition") ?? "")?.[1] ?? name;
    const link = make("a");
    link.href = URL.createObjectURL(await answer.blob());
    link.download = file;
    // Outside the page: a click in it would close the menu if it is open again by now.
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    say({ text: `${file} is handed to the browser to be saved.` });
  };

  // ---- what is being done
  const showJob = (job) => {
    state.job = job;
    const box = $("job");
    box.classList.toggle("quiet", !job);
    $("job-text").textContent = job ? (job.stage ? `${job.what}: ${job.stage}` : job.what) : "Ready";
    $("job-bar").hidden = !job;
    if (job) $("job-bar").value = job.fraction;
    $("cancel").hidden = !job;
    arm();
  };

  const showBusy = (busy) => { state.busy = busy; arm(); };

  // ---- law and plots
  const showLaw = (law) => {
    $("overview").hidden = !law;
    if (!law) return;
    $("title").textContent = law.title || "A learned model";
    document.title = `${law.title || "A learned model"} - Leverrier studio`;
    for (const part of ["cards", "equations", "numbers", "findings", "data"]) $(part).innerHTML = law[part];
  };
  const ORDER = ["horizons", "forces", "predictions", "portrait", "energy", "force-map", "ranking", "ledger", "front", "path"];
  const GROUPS = [
    ["How far it holds", ["horizons", "forces", "force-map"]],
    ["The motion", ["predictions", "portrait", "energy"]],
    ["What was found, and how", ["ranking", "ledger", "front", "path"]],
  ];
  let picked = null;
  let drawn = new Map();
  const showFigures = (plots) => {
    // Plots that are still to come stay as they were, in grey.
    const by = new Map(plots.map((plot) => [plot.plot,
      plot.pending ? { ...plot, figures: drawn.get(plot.plot)?.figures ?? [] } : plot]));
    drawn = by;
    const known = new Set(ORDER);
    const groups = GROUPS.map(([title, names]) => [title, names]);
    const others = plots.map((plot) => plot.plot).filter((name) => !known.has(name));
    if (others.length) groups.push(["Further", others]);
    const sections = [];
    for (const [title, names] of groups) {
      const figures = names.flatMap((name) => (by.get(name)?.figures ?? []).map((figure, at) => [[name, at], figure]));
      if (!figures.length) continue;
      const section = make("section", "plot");
      section.setAttribute("aria-label", title);
      section.append(make("h2", "", title));
      const grid = make("div", "figures");
      for (const [at, figure] of figures) {
        const box = make("figure", by.get(at[0]).pending ? "pending" : "");
        box.innerHTML = figure.svg;
        const caption = make("figcaption", "", `${figure.caption} `);
        for (const kind of ["SVG", "PNG"]) {
          const button = make("button", "plain", kind);
          button.type = "button";
          button.setAttribute("aria-label", `Save “${figure.title}” as ${kind}`);
          const name = kind.toLowerCase();
          button.addEventListener("click", () => fetchFile(`plot.${name}`, `/api/plots?as=${name}&plot=${at[0]}&at=${at[1]}`));
          caption.append(button);
        }
        box.append(caption);
        grid.append(box);
      }
      section.append(grid);
      sections.push(section);
    }
    $("figures").replaceChildren(...sections);
    $("empty").hidden = sections.length > 0;
    leverrierFigures();
    const runs = [...new Set([...document.querySelectorAll("#figures path[data-run]:not([data-times])")].map((path) => path.dataset.run))];
    $("look").hidden = !runs.length;
    const select = $("look-run");
    const old = select.value;
    select.replaceChildren(...runs.map((run) => { const option = make("option", "", run); option.value = run; return option; }));
    if (runs.includes(old)) select.value = old;
    span();
    if (picked) document.dispatchEvent(new CustomEvent("leverrier-brush", { detail: picked }));
  };
  // The time axis of a run, as its panels have it.
  const axisOf = (run) => {
    const path = [...document.querySelectorAll("#figures path[data-run]:not([data-times])")].find((p) => p.dataset.run === run);
    const panel = path?.closest("g.panel");
    if (!panel) return null;
    const [low, high] = panel.dataset.x.split(" ").map(Number);
    return { name: panel.dataset.names.split("|")[0], low, high };
  };
  const span = () => {
    const axis = axisOf($("look-run").value);
    if (!axis) return;
    const third = (axis.high - axis.low) / 3;
    if (!$("look-from").value) $("look-from").value = +(axis.low + third).toPrecision(3);
    if (!$("look-to").value) $("look-to").value = +(axis.low + 2 * third).toPrecision(3);
  };
  document.addEventListener("leverrier-brush", ({ detail }) => {
    picked = detail;
    if (!detail) return;
    if (detail.runs.length) $("look-run").value = detail.runs[0];
    $("look-from").value = +detail.from.toPrecision(4);
    $("look-to").value = +detail.to.toPrecision(4);
  });
  $("look").addEventListener("submit", (event) => {
    event.preventDefault();
    const run = $("look-run").value;
    const axis = axisOf(run);
    const [from, to] = [$("look-from").valueAsNumber, $("look-to").valueAsNumber];
    if (!axis || !Number.isFinite(from) || !Number.isFinite(to)) return;
    document.dispatchEvent(new CustomEvent("leverrier-brush", {
      detail: { name: axis.name, runs: [run], from: Math.min(from, to), to: Math.max(from, to) },
    }));
  });
  $("look-clear").addEventListener("click", () => {
    document.dispatchEvent(new CustomEvent("leverrier-brush", { detail: null }));
  });

  // ---- what is missing
  const VERDICTS = {
    missing: "Something is missing", explained_in_part: "A part of what is missing is explained", nothing_missing: "Nothing is missing",
    unexplained: "Something is missing that has no name here",
    too_little_data: "Too little data to say", interrupted: "Interrupted",
  };
  const STATES = {
    pending: "The diagnosis comes after the plots.", running: "Every effect of the catalogue is being tested.",
    stopped: "The diagnosis was cancelled.", none: "There is no model to diagnose.",
  };
  const SVG = "http://www.w3.org/2000/svg";
  // A bar of an error, with a line at the noise floor.
  const bar = (value, most, className) => {
    const box = make("span", "bar");
    const svg = document.createElementNS(SVG, "svg");
    svg.setAttribute("viewBox", "0 0 100 10");
    svg.setAttribute("preserveAspectRatio", "none");
    svg.setAttribute("aria-hidden", "true");
    const rect = document.createElementNS(SVG, "rect");
    const share = (x) => String(100 * Math.min(1, Math.max(0, x / most)));
    for (const [name, to] of [["width", share(value)], ["height", "10"], ["rx", "1"], ["class", `value ${className}`]]) rect.setAttribute(name, to);
    const line = document.createElementNS(SVG, "line");
    for (const [name, to] of [["x1", share(1)], ["x2", share(1)], ["y1", "-2"], ["y2", "12"], ["class", "floor"]]) line.setAttribute(name, to);
    svg.append(rect, line);
    box.append(svg);
    return box;
  };
  const level = (value) => (value < 1.25 ? "low" : "high");
  const card = (leader, first) => {
    const row = make("li", first ? "leader first" : "leader");
    const head = make("div", "head");
    head.append(make("span", "name", leader.effect));
    const button = make("button", first ? "main" : "", "Add");
    button.type = "button";
    button.dataset.wish = "add";
    button.dataset.effect = leader.effect;
    button.setAttribute("aria-label", `Add ${leader.effect}`);
    button.title = leader.snippet;
    button.addEventListener("click", () => add(leader.snippet.replace(/^effect\s+/, "")));
    // What stands in the spec already needs no statement.
    if (leader.snippet) head.append(button);
    row.append(head);
    if (leader.physics) row.append(make("p", "soft", leader.physics));
    if (leader.before !== null && leader.after !== null) {
      const bars = make("div", "bars");
      const most = 1.08 * Math.max(leader.before, leader.after, 1);
      for (const [name, value] of [["now", leader.before], ["with it", leader.after]]) {
        bars.append(make("span", "", name), bar(value, most, level(value)), make("b", "", two(value)));
      }
      bars.setAttribute("role", "img");
      bars.setAttribute("aria-label", `Error on held-out runs: ${two(leader.before)} times the noise now, ${two(leader.after)} with it`);
      row.append(bars);
    }
    row.append(make("p", "soft", `p-value: ${leader.p_value}`));
    return row;
  };
  const showMissing = (missing) => {
    state.missing = missing;
    const verdict = $("verdict");
    const leaders = $("leaders");
    $("tested").textContent = missing.tested ?? "";
    if (missing.state !== "answered") {
      verdict.replaceChildren(make("p", "soft", STATES[missing.state] ?? ""));
      if (missing.state === "stopped") {
        const again = make("button", "", "Ask again");
        again.type = "button";
        again.dataset.wish = "diagnose";
        again.addEventListener("click", () => wish({ do: "diagnose" }));
        verdict.append(again);
      }
      leaders.replaceChildren();
      return;
    }
    const box = make("div", `verdict ${missing.verdict}`);
    box.append(make("strong", "", VERDICTS[missing.verdict] ?? missing.verdict), make("span", "", `${missing.reason}.`));
    if (missing.indistinguishable) box.append(make("p", "", missing.indistinguishable));
    if (missing.further.length) box.append(make("p", "", `It explains the runs together with ${missing.further.join(" and ")}.`));
    if (missing.partial) box.append(make("p", "", missing.partial));
    verdict.replaceChildren(box);
    const shown = missing.leaders.slice(0, 6).map((leader, at) => card(leader, at === 0 && missing.verdict === "missing"));
    if (missing.unnamed) {
      const unnamed = make("li", "leader");
      unnamed.append(make("p", "", "The best term without a name, to be understood before it is used:"), make("pre", "small", missing.unnamed.snippet));
      shown.push(unnamed);
    }
    leaders.replaceChildren(...shown);
    arm();
  };

  // ---- steps
  const showLedger = (ledger) => {
    state.ledger = ledger;
    const steps = ledger.steps.map((step, at) => ({ ...step, error: step.after ?? ledger.steps[at + 1]?.before ?? null }));
    const most = 1.08 * Math.max(1, ...steps.map((step) => step.error ?? 0));
    $("ledger").replaceChildren(...steps.map((step) => {
      const row = make("li", `step${step.undone ? " undone" : ""}${step.current ? " current" : ""}`);
      const what = make("span", "what", step.action);
      what.title = `${step.date} UTC`;
      row.append(what, make("b", "", step.error === null ? "" : two(step.error)));
      if (step.undone) row.append(make("span", "soft small", "undone"));
      if (step.error !== null) row.append(bar(step.error, most, level(step.error)));
      return row;
    }));
    if (!steps.length) $("ledger").replaceChildren(make("li", "soft small", "Nothing was added to the spec yet."));
    $("steps-unit").hidden = !steps.some((step) => step.error !== null);
    arm();
  };
  const showEffects = (effects) => {
    $("effects-box").hidden = !effects.length;
    $("effects").replaceChildren(...effects.map((effect) => {
      const row = make("li", "", effect);
      const button = make("button", "", "Remove");
      button.type = "button";
      button.dataset.wish = "remove";
      button.setAttribute("aria-label", `Remove ${effect}`);
      button.addEventListener("click", () => guarded(() => wish({ do: "remove", effect })));
      row.append(button);
      return row;
    }));
    arm();
  };
  const showFailure = (failure) => {
    $("failure").hidden = !failure;
    if (!failure) return;
    $("failure").textContent = `There is no model: ${failure.message}${failure.hint ? ` (${failure.hint})` : ""}.`;
    $("empty").hidden = true;
  };

  // ---- news
  const SHOW = { spec: showSpec, ledger: showLedger, law: showLaw, figures: showFigures, missing: showMissing,
    effects: showEffects, failure: showFailure, job: showJob, busy: showBusy, message: say };
  const listen = async () => {
    let version = 0;
    let silent = 0;
    for (;;) {
      try {
        const answer = await ask(`/api/state?since=${version}`);
        if (answer.status === 401) {
          showJob(null);
          $("job-text").textContent = "No access";
          say({ ...(await why(answer)), failed: true });
          return;
        }
        const news = await answer.json();
        if (silent) $("message").hidden = true;
        silent = 0;
        version = news.version;
        // The spec and the job last: buttons depend on what stands before.
        for (const name of Object.keys(SHOW)) if (name in news.parts) SHOW[name](news.parts[name]);
        document.documentElement.dataset.version = String(version);
      } catch {
        silent += 1;
        if (silent === 3) {
          showJob(null);
          $("job-text").textContent = "Ended";
          say({ text: "The studio has ended. Start it again with `leverrier studio`.", failed: true });
        }
        await new Promise((done) => setTimeout(done, Math.min(4000, 250 * silent)));
      }
    }
  };

  // ---- hands
  $("learn").addEventListener("click", () => save(true));
  $("save").addEventListener("click", () => save(false));
  $("reload").addEventListener("click", () => { editor.text = state.spec.text; arm(); });
  $("undo").addEventListener("click", undo);
  $("cancel").addEventListener("click", () => ask("/api/cancel", {}));
  $("help").addEventListener("click", () => $("keys").showModal());
  $("add").addEventListener("submit", (event) => {
    event.preventDefault();
    const effect = $("add-name").value.trim();
    if (effect) add(effect);
  });
  document.addEventListener("click", (event) => {
    if (!$("export").contains(event.target)) $("export").open = false;
  });
  addEventListener("beforeunload", (event) => { if (dirty()) event.preventDefault(); });
  addEventListener("keydown", (event) => {
    const typing = event.target.matches?.("textarea, input, select");
    const key = event.key.toLowerCase();
    const act = (what) => { event.preventDefault(); what(); };
    if ((event.ctrlKey || event.metaKey) && key === "s") act(() => save(false));
    else if ((event.ctrlKey || event.metaKey) && key === "enter") act(() => save(true));
    else if (event.altKey && key === "z") act(undo);
    else if (event.altKey && key === "a") act(() => document.querySelector(".leader button[data-wish=add]:not(:disabled)")?.click());
    else if (event.altKey && "1234".includes(key)) {
      act(() => (key === "1" ? $("text") : $(["plots", "missing", "steps"][key - 2])).focus());
    } else if (key === "?" && !typing) act(() => $("keys").showModal());
    else if (key === "escape" && $("export").open) { $("export").open = false; $("export").querySelector("summary").focus(); }
  });
  showJob({ what: "Opening", stage: "", fraction: 0, background: true });
  if (token) listen();
  else {
    showJob(null);
    $("job-text").textContent = "No access";
    say({ text: "Open the address that the studio printed when it was started: it ends in the key to this page.", failed: true });
  }
})();
