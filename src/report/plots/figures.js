// Figures that answer: point at a series and read its values; drag over a stretch of time and see
// it in every other figure of the same run. Values are read back from the paths themselves.
"use strict";
(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const axis = (text) => {
    const [low, high, scale] = text.split(" ");
    return { low: +low, high: +high, log: scale === "logarithmic" };
  };
  const back = (a, share) =>
    a.log ? Math.exp(Math.log(a.low) + share * (Math.log(a.high) - Math.log(a.low)))
          : a.low + share * (a.high - a.low);
  const place = (a, value) =>
    a.log ? (Math.log(value) - Math.log(a.low)) / (Math.log(a.high) - Math.log(a.low))
          : (value - a.low) / (a.high - a.low);
  const short = (x) => Number.parseFloat(x.toPrecision(4)).toString().replace("-", "\u2212");

  const panelOf = (g) => {
    const [left, top, width, height] = g.dataset.frame.split(" ").map(Number);
    const [xName, xUnit, yName, yUnit] = g.dataset.names.split("|");
    return { g, left, top, width, height, x: axis(g.dataset.x), y: axis(g.dataset.y),
             xName, xUnit, yName, yUnit, paths: null };
  };
  const pathsOf = (panel) => {
    panel.paths ??= [...panel.g.querySelectorAll("path[data-series]")].map((path) => ({
      path,
      points: [...path.getAttribute("d").matchAll(/[ML](-?[\d.]+) (-?[\d.]+)/g)]
        .map((m) => [+m[1], +m[2]]),
      times: path.dataset.times ? path.dataset.times.split(" ").map(Number) : null,
    }));
    return panel.paths;
  };

  const tip = document.createElement("div");
  tip.className = "figure-tip";
  tip.hidden = true;

  const setUp = (svg) => {
    if (svg.dataset.alive) return;
    svg.dataset.alive = "1";
    const panels = [...svg.querySelectorAll("g.panel")].map(panelOf);
    const at = (event) => {
      const matrix = svg.getScreenCTM();
      return matrix ? new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse()) : null;
    };
    const find = (p) => p && panels.find((f) =>
      p.x >= f.left && p.x <= f.left + f.width && p.y >= f.top && p.y <= f.top + f.height);
    let start = null;
    const show = (event) => {
      const p = at(event);
      const panel = find(p);
      let best = null;
      for (const { path, points } of panel ? pathsOf(panel) : []) {
        for (const [x, y] of points) {
          const far = (x - p.x) ** 2 + (y - p.y) ** 2;
          if (far < 400 && (!best || far < best.far)) best = { far, x, y, path };
        }
      }
      if (!best) { tip.hidden = true; return; }
      const x = back(panel.x, (best.x - panel.left) / panel.width);
      const y = back(panel.y, 1 - (best.y - panel.top) / panel.height);
      const run = best.path.dataset.run ? `, run ${best.path.dataset.run}` : "";
      tip.textContent = `${best.path.dataset.series}${run}\n` +
        `${panel.xName || "x"} = ${short(x)} ${panel.xUnit}\n${panel.yName || "y"} = ${short(y)} ${panel.yUnit}`;
      tip.hidden = false;
      tip.style.left = `${Math.min(event.clientX + 14, innerWidth - tip.offsetWidth - 8)}px`;
      tip.style.top = `${Math.min(event.clientY + 14, innerHeight - tip.offsetHeight - 8)}px`;
    };
    svg.addEventListener("pointermove", (event) => {
      show(event);
      if (!start) return;
      const p = at(event);
      brush(start.panel, start.x, Math.min(Math.max(p.x, start.panel.left), start.panel.left + start.panel.width));
    });
    svg.addEventListener("pointerleave", () => { tip.hidden = true; });
    svg.addEventListener("pointerdown", (event) => {
      const p = at(event);
      const panel = find(p);
      if (!panel || !pathsOf(panel).some(({ path, times }) => path.dataset.run && !times)) return;
      start = { panel, x: p.x };
      document.dispatchEvent(new CustomEvent("leverrier-brush", { detail: null }));
    });
    addEventListener("pointerup", () => { start = null; });
    const brush = (panel, a, b) => {
      const runs = new Set(pathsOf(panel).map(({ path }) => path.dataset.run).filter(Boolean));
      const value = (x) => back(panel.x, (x - panel.left) / panel.width);
      const detail = { name: panel.xName, runs: [...runs],
                       from: value(Math.min(a, b)), to: value(Math.max(a, b)) };
      document.dispatchEvent(new CustomEvent("leverrier-brush", { detail }));
    };
    document.addEventListener("leverrier-brush", ({ detail }) => {
      svg.querySelectorAll(".picked").forEach((mark) => mark.remove());
      if (!detail) return;
      for (const panel of panels) {
        const own = pathsOf(panel).filter(({ path }) => detail.runs.includes(path.dataset.run));
        if (!own.length) continue;
        for (const { path, points, times } of own) {
          if (!times) continue;
          const d = points.filter((_, i) => times[i] >= detail.from && times[i] <= detail.to)
            .map(([x, y]) => `M${x} ${y}h0`).join("");
          const picked = document.createElementNS(SVG, "path");
          picked.setAttribute("class", "cloud picked");
          picked.setAttribute("d", d);
          path.after(picked);
        }
        if (own.some(({ times }) => !times) && panel.xName === detail.name) {
          const x = (value) => panel.left + panel.width * Math.min(1, Math.max(0, place(panel.x, value)));
          const area = document.createElementNS(SVG, "rect");
          area.setAttribute("class", "picked area");
          area.setAttribute("x", x(detail.from));
          area.setAttribute("y", panel.top);
          area.setAttribute("width", Math.max(1, x(detail.to) - x(detail.from)));
          area.setAttribute("height", panel.height);
          panel.g.append(area);
        }
      }
    });
  };

  const all = () => {
    if (!tip.isConnected) document.body.append(tip);
    document.querySelectorAll("svg.figure").forEach(setUp);
  };
  addEventListener("keydown", (event) => {
    if (event.key === "Escape") document.dispatchEvent(new CustomEvent("leverrier-brush", { detail: null }));
  });
  // Pages that change call this after new figures have come.
  globalThis.leverrierFigures = all;
  if (document.readyState === "loading") addEventListener("DOMContentLoaded", all); else all();
})();
