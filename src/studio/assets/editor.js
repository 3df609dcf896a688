// The spec's text with numbers of lines, colours and what is wrong with it, in place.
"use strict";
globalThis.leverrierEditor = (() => {
  const WORDS = "system|coordinates|momenta|velocities|time|data|param|body|effect|force|sensor|constrain|candidates|constant|for|in|span|pairs|run|every|noise";
  const TOKENS = new RegExp([
    "(?<comment>#.*)", "(?<string>\"[^\"\\n]*\"?)", "(?<unit>\\[[a-zA-Z][^\\]\\n]*\\])",
    `(?<keyword>\\b(?:${WORDS})\\b|\\b[TVH](?=\\s*=))`,
    "(?<function>\\b[a-z_][\\w]*(?=\\())", "(?<number>\\b\\d+\\.?\\d*(?:[eE][+-]?\\d+)?\\b)",
  ].join("|"), "g");
  const element = (id) => document.getElementById(id);

  // Cuts [start, end, class] into pieces of the text; classes may overlap.
  const pieces = (text, marks) => {
    const cuts = new Set([0, text.length]);
    for (const [start, end] of marks) { cuts.add(start); cuts.add(end); }
    const at = [...cuts].filter((x) => x >= 0 && x <= text.length).sort((a, b) => a - b);
    return at.slice(0, -1).map((start, i) => ({
      text: text.slice(start, at[i + 1]),
      classes: marks.filter(([a, b]) => a <= start && b >= at[i + 1]).map((mark) => mark[2]),
    }));
  };

  const make = (check, changed) => {
    const area = element("text");
    let problems = [];
    let timer = null;
    let asked = 0;

    const paint = () => {
      const text = area.value;
      const marks = [...text.matchAll(TOKENS)].map((m) => {
        const name = Object.keys(m.groups).find((key) => m.groups[key] !== undefined);
        return [m.index, m.index + m[0].length, `c-${name}`];
      });
      for (const problem of problems) {
        marks.push([problem.start, Math.max(problem.end, problem.start + 1), "wrong"]);
      }
      const painted = pieces(text, marks).map(({ text: part, classes }) => {
        if (!classes.length) return document.createTextNode(part);
        const span = document.createElement("span");
        span.className = classes.join(" ");
        span.textContent = part;
        return span;
      });
      element("colours").replaceChildren(...painted, document.createTextNode("\n"));
      const bad = new Set(problems.map((problem) => problem.line));
      const numbers = text.split("\n").map((_, i) => {
        const line = document.createElement("span");
        line.textContent = `${i + 1}\n`;
        if (bad.has(i + 1)) line.className = "bad";
        return line;
      });
      element("lines").replaceChildren(...numbers);
      scroll();
    };
    const scroll = () => {
      element("colours").scrollTop = area.scrollTop;
      element("colours").scrollLeft = area.scrollLeft;
      element("lines").scrollTop = area.scrollTop;
    };
    const list = () => {
      element("problems").replaceChildren(...problems.map((problem) => {
        const row = document.createElement("button");
        row.type = "button";
        row.className = `problem ${problem.severity}`;
        const head = document.createElement("b");
        head.textContent = `Line ${problem.line}: ${problem.message}`;
        row.append(head);
        for (const more of [problem.label, problem.hint]) {
          if (!more) continue;
          const line = document.createElement("span");
          line.textContent = more;
          row.append(line);
        }
        row.addEventListener("click", () => {
          area.focus();
          area.setSelectionRange(problem.start, problem.end);
          area.scrollTop = Math.max(0, (problem.line - 4) * 20);
        });
        return row;
      }));
      const wrong = problems.some((problem) => problem.severity === "error");
      area.setAttribute("aria-invalid", String(wrong));
      changed();
    };
    const look = async () => {
      const own = ++asked;
      const found = await check(area.value);
      if (own !== asked || !found) return;
      problems = found;
      paint();
      list();
    };
    area.addEventListener("input", () => {
      // Marks of the text as it was would stand at the wrong places.
      problems = [];
      paint();
      changed();
      clearTimeout(timer);
      timer = setTimeout(look, 250);
    });
    area.addEventListener("scroll", scroll);
    return {
      get text() { return area.value; },
      set text(text) { area.value = text; problems = []; paint(); look(); },
      get wrong() { return problems.some((problem) => problem.severity === "error"); },
    };
  };
  return make;
})();
