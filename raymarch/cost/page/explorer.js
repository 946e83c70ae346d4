"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const at = (id) => document.getElementById(id);
  const { points, pictures, errors, costs } = data;
  const SHAPES = { // one of each tracer, so that colours are not needed to tell them apart
    plain: "M-4.5,-4.5H4.5V4.5H-4.5Z", relaxed: "M0,-6L5.5,4H-5.5Z", relaxed_again: "M0,6L5.5,-4H-5.5Z",
    enhanced: "M0,-6.2L6.2,0L0,6.2L-6.2,0Z", auto_relaxed: "M-5,0A5,5 0 1 0 5,0A5,5 0 1 0 -5,0Z",
    bracketing: "M0,-6.2L1.7,-2.1L6.1,-1.9L2.7,.9L3.8,5.1L0,2.7L-3.8,5.1L-2.7,.9L-6.1,-1.9L-1.7,-2.1Z",
  };
  const color = (tracer) => (SHAPES[tracer] ? `var(--${tracer})` : "var(--soft)");
  const shape = (tracer) => SHAPES[tracer] || SHAPES.auto_relaxed;

  // Numbers: two or three significant digits, never an exponent.
  const text = (value, digits = 2) => {
    if (value === null || value === undefined) return "unknown";
    if (Math.abs(value) >= 1000) return Math.round(value).toLocaleString("en").replace(/,/g, " ");
    if (Math.abs(value) >= 100) return String(Math.round(value));
    return String(parseFloat(value.toPrecision(digits)).toFixed(10)).replace(/\.?0+$/, "");
  };
  const withUnit = (value, unit) => text(value) + (unit === "°" ? unit : unit ? " " + unit : "");
  const words = (p) => {
    const off = errors[state.error] ? withUnit(p.errors[state.error], errors[state.error].unit) : "";
    return `${off} ${errors[state.error].label}; ${withUnit(p.costs[state.cost], costs[state.cost].unit)}`;
  };
  const figures = (p) => {
    if (!p) return "float64, on the CPU";
    const parts = [`<strong>${text(p.costs.ms)} ms</strong> (${text(p.interval[0])} to ${text(p.interval[1])})`,
      `<strong>${text(p.errors.pixels_p99)} px</strong> (largest ${text(p.errors.pixels_max)})`,
      `normals ${text(p.errors.normal_p99)}°`, `FLIP ${text(p.errors.flip_p99)}`,
      `${p.errors.wrong} missed or false`, `${text(p.costs.evaluations, 3)} evaluations`,
      `shader ${text(p.costs.shader_bytes)} bytes`, `first frame ${text(p.costs.first_ms)} ms`];
    return parts.join("; ") + (p.comparable ? "" : `; compared with ${p.against}`);
  };

  const state = {
    error: errors[data.metric] ? data.metric : "pixels_p99", cost: "ms", now: 0, chosen: [], kind: "map",
    hidden: { tracers: new Set(), schedules: new Set(), changes: new Set() },
  };

  // The front of the chosen axes: no other setting is both cheaper and more accurate.
  const usable = (p) => p.errors[state.error] !== null && p.comparable &&
    (state.error === "wrong" || p.sound) && (state.error.startsWith("flip") || !p.light);
  const group = (p) => (p.base ? "the scene's own" : p.preset ? "presets" : p.changes.join(", ") || "nothing");
  const visible = () => points.filter((p) => usable(p) && !state.hidden.tracers.has(p.tracer) &&
    !state.hidden.schedules.has(p.schedule) && !state.hidden.changes.has(group(p)));
  const frontOf = (list) => {
    let best = Infinity;
    return [...list].sort((p, q) => p.costs[state.cost] - q.costs[state.cost] || p.errors[state.error] - q.errors[state.error])
      .filter((p) => p.errors[state.error] < best && ((best = p.errors[state.error]), true));
  };

  // Scales

  const scale = (values, low, high, zero) => {
    const positive = values.filter((v) => v > 0);
    let least = Math.min(...positive), most = Math.max(...positive);
    if (!positive.length) [least, most] = [0.1, 1];
    const pad = Math.max(Math.pow(most / least, 0.07), 1.12);
    least /= pad; most *= pad;
    const zeroes = zero && values.some((v) => v <= 0), gap = zeroes ? 26 * Math.sign(high - low) : 0;
    const place = (v) => (v > 0 ? low + gap + (high - low - gap) * Math.log(v / least) / Math.log(most / least) : low + gap / 3);
    const ticks = [];
    for (const steps of [[1, 1.5, 2, 3, 4, 5, 7], [1, 2, 5], [1, 3], [1]]) {
      ticks.length = 0;
      for (let k = Math.floor(Math.log10(least)); k <= Math.log10(most); k++)
        for (const m of steps) { const v = m * Math.pow(10, k); if (v >= least && v <= most) ticks.push(v); }
      if (ticks.length * 46 <= Math.abs(high - low)) break;
    }
    if (ticks.length < 2) { // a narrow range: evenly spaced round numbers
      ticks.length = 0;
      const raw = (most - least) / 5, power = Math.pow(10, Math.floor(Math.log10(raw)));
      const step = power * [1, 2, 5, 10].find((m) => m * power >= raw);
      for (let v = Math.ceil(least / step) * step; v <= most; v += step) ticks.push(v);
    }
    if (zeroes) ticks.push(0);
    return { place, ticks };
  };
  const tick = (v) => (v >= 1000 ? text(v) : String(parseFloat(v.toPrecision(3))).includes("e") ? text(v) : String(parseFloat(v.toPrecision(3))));

  // The plot

  const svg = at("plot");
  let places = [];
  const draw = () => {
    const width = Math.max(svg.clientWidth, 280), height = width < 520 ? 340 : 430;
    const right = width - 16, top = 26, bottom = height - 46;
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.style.height = height + "px";
    const list = visible(), front = frontOf(list), onFront = new Set(front);
    const ex = errors[state.error], cx = costs[state.cost];
    const labels = [], crowded = width < 520;
    const y = scale(list.map((p) => p.errors[state.error]), bottom, top, true);
    const left = Math.max(58, 16 + 7 * Math.max(0, ...y.ticks.map((v) => tick(v).length)));  // beside the longest number
    const parts = [];
    if (list.length) {
      const x = scale(list.map((p) => p.costs[state.cost]), left, right, false);
      for (const v of x.ticks) parts.push(`<line class="grid" x1="${x.place(v)}" x2="${x.place(v)}" y1="${top}" y2="${bottom}"/>` +
        `<text text-anchor="middle" x="${x.place(v)}" y="${bottom + 17}">${tick(v)}</text>`);
      for (const v of y.ticks) parts.push(`<line class="grid" x1="${left}" x2="${right}" y1="${y.place(v)}" y2="${y.place(v)}"/>` +
        `<text text-anchor="end" x="${left - 7}" y="${y.place(v) + 4}">${tick(v)}</text>`);
      if (state.error === "pixels_p99") for (const v of [0.5, 0.05, 0.005]) {
        const h = y.place(v);
        if (h > top && h < bottom) parts.push(`<line class="bound" x1="${left}" x2="${right}" y1="${h}" y2="${h}"/>` +
          `<text class="halo" text-anchor="end" x="${right}" y="${h - 4}">${v + " px"}</text>`);
      }
      places = list.map((p) => ({ p, x: x.place(p.costs[state.cost]), y: y.place(p.errors[state.error]) }));
      const spot = new Map(places.map((s) => [s.p, s]));
      let path = "";
      front.forEach((p, k) => { const s = spot.get(p); path += k ? `H${s.x}V${s.y}` : `M${s.x},${s.y}`; });
      if (front.length) parts.push(`<path class="front" d="${path}H${right}"/>`);
      places.sort((a, b) => onFront.has(a.p) - onFront.has(b.p) || a.x - b.x);
      for (const s of places) {
        const p = s.p, index = points.indexOf(p), letter = state.chosen.indexOf(index);
        const tone = color(p.tracer), lit = onFront.has(p);
        if (state.cost === "ms" && (lit || index === state.now)) parts.push(
          `<line class="whisker" stroke="${tone}" x1="${Math.max(left, x.place(p.interval[0]))}" x2="${Math.min(right, x.place(p.interval[1]))}" y1="${s.y}" y2="${s.y}"/>`);
        const classes = ["point", lit ? "" : "dim", index === state.now ? "now" : "", letter >= 0 ? "chosen" : ""].join(" ");
        parts.push(`<g class="${classes}" data-index="${index}" transform="translate(${s.x} ${s.y})" role="button" tabindex="${index === state.now ? 0 : -1}"` +
          ` aria-pressed="${letter >= 0}" aria-label="${escape(p.name)}, ${p.tracer}: ${escape(words(p))}${lit ? "; on the front" : ""}">` +
          `<circle class="mark" r="10"/><path d="${shape(p.tracer)}" fill="${lit ? tone : "var(--paper)"}" stroke="${tone}"/>` +
          `<text class="letter halo" x="-5" y="-13">${letter >= 0 ? "AB"[letter] : ""}</text></g>`);
        if (p.preset || p.base || (lit && p.bound)) labels.push({ s, name: p.preset || (p.base ? "the scene's own" : p.name) });
      }
      // Direct labels: beside the point, over no mark and no other label, else farther away with a line to the point.
      // Points that lie together share a label.
      labels.sort((a, b) => !!b.s.p.preset - !!a.s.p.preset);
      const groups = [];
      for (const { s, name } of labels) {
        const near = groups.find((g) => (g.s.x - s.x) ** 2 + (g.s.y - s.y) ** 2 < 12 * 12);
        if (!near) groups.push({ s, names: [name] });
        else if (!near.names.includes(name)) near.names.push(name);
      }
      const taken = places.filter((s) => onFront.has(s.p) || labels.some((l) => l.s === s))
        .map((s) => [s.x - 6, s.y - (state.chosen.includes(points.indexOf(s.p)) ? 24 : 6), s.x + 6, s.y + 6]);
      const spots = [];
      for (const far of [0, 16, 34, 54, 76])
        for (const [x, y] of [[1, -1], [1, 1], [-1, -1], [-1, 1]]) spots.push([x * (9 + far / 2), y < 0 ? -7 - far : 15 + far, x > 0 ? "start" : "end", far]);
      for (const { s, names } of groups) {
        const name = names.slice(0, 3).join(", ") + (names.length > 3 ? " ..." : ""), wide = name.length * 6.9 + 4;
        for (const [dx, dy, anchor, far] of spots) {
          const x0 = anchor === "start" ? s.x + dx : s.x + dx - wide, box = [x0, s.y + dy - 11, x0 + wide, s.y + dy + 3];
          if (box[0] < left || box[2] > right + 8 || box[1] < top - 14 || box[3] > bottom) continue;
          if (taken.some((t) => t[0] < box[2] + 5 && t[2] > box[0] - 5 && t[1] < box[3] && t[3] > box[1])) continue;
          taken.push(box);
          if (far) parts.push(`<line class="leader" x1="${s.x}" y1="${s.y}" x2="${s.x + dx}" y2="${dy < 0 ? box[3] : box[1]}"/>`);
          parts.push(`<text class="name halo" aria-hidden="true" text-anchor="${anchor}" x="${s.x + dx}" y="${s.y + dy}">${escape(name)}</text>`);
          break;
        }
      }
    } else { places = []; parts.push(`<text x="${left}" y="${top + 30}">No setting is left by the filters.</text>`); }
    const unit = (d) => (d.unit ? `, ${d.unit === "°" ? "degrees" : d.unit}` : "");
    parts.push(`<text class="title" x="8" y="13">↑ ${escape(ex.label + (crowded ? "" : unit(ex)))}</text>` +
      `<text class="title" text-anchor="end" x="${right}" y="${height - 8}">${escape(cx.label + unit(cx))} →</text>`);
    const had = svg.contains(document.activeElement);
    svg.innerHTML = parts.join("");
    if (!svg.querySelector('[tabindex="0"]')) svg.querySelector(".point")?.setAttribute("tabindex", 0);
    if (had) svg.querySelector('[tabindex="0"]')?.focus();
    at("count").textContent = `(${list.length} of ${points.length} settings)`;
  };
  const escape = (s) => s.replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);

  // The setting that is shown

  const show = (index, redraw = true) => {
    state.now = index;
    const p = points[index];
    const lit = frontOf(points.filter(usable)).includes(p);
    at("shown").innerHTML = escape(p.name) + (lit ? '<span class="badge">front</span>' : "") +
      (p.finest ? '<span class="badge">none is surely more exact</span>' : "");
    at("figures").innerHTML = `${escape(p.tracer)}; ${figures(p)}`;
    at("shown-picture").src = pictures[p.picture ?? data.reference];
    at("shown-picture").alt = `picture with ${p.name}`;
    at("shown-map").src = pictures[p.map];
    at("shown-map").alt = `error map of ${p.name}: ${p.where}`;
    at("where").textContent = `${p.where[0].toUpperCase()}${p.where.slice(1)} The largest is ${text(p.worst[2])} px.`;
    const ring = at("ring");
    ring.hidden = !p.worst[2];
    ring.style.left = (100 * p.worst[0]) / data.size[0] + "%";
    ring.style.top = (100 * p.worst[1]) / data.size[1] + "%";
    at("code").textContent = p.code;
    if (!redraw) return;
    for (const g of svg.querySelectorAll(".point")) {
      const own = +g.dataset.index === index;
      g.classList.toggle("now", own);
      g.setAttribute("tabindex", own ? 0 : -1);
    }
  };
  const nearest = (event) => {
    const box = svg.getBoundingClientRect(), view = svg.viewBox.baseVal;
    const x = ((event.clientX - box.left) * view.width) / box.width, y = ((event.clientY - box.top) * view.height) / box.height;
    let best = null, least = 45 * 45;
    for (const s of places) {
      const far = (s.x - x) ** 2 + (s.y - y) ** 2;
      if (far <= least) [best, least] = [s.p, far];
    }
    return best;
  };
  svg.addEventListener("pointermove", (event) => {
    const p = nearest(event);
    if (p && points.indexOf(p) !== state.now) show(points.indexOf(p));
  });
  svg.addEventListener("click", (event) => {
    const p = nearest(event);
    if (p) { show(points.indexOf(p)); choose(points.indexOf(p)); }
  });
  svg.addEventListener("focusin", (event) => {
    const g = event.target.closest(".point");
    if (g) show(+g.dataset.index);
  });
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    const order = [...places].sort((a, b) => a.x - b.x || a.y - b.y).map((s) => points.indexOf(s.p));
    if (step || event.key === "Home" || event.key === "End") {
      event.preventDefault();
      const k = order.indexOf(state.now);
      const next = event.key === "Home" ? 0 : event.key === "End" ? order.length - 1 : (k + step + order.length) % order.length;
      svg.querySelector(`[data-index="${order[next]}"]`)?.focus();
    } else if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      choose(state.now);
    }
  });

  // Pictures with a slider between them

  const splitter = (node, label) => {
    node.innerHTML = '<img alt="" draggable="false"><img class="over" alt="" draggable="false"><span class="bar"></span><b class="left"></b><b class="rightname"></b>' +
      `<input type="range" min="0" max="1000" value="500" aria-label="${label}">`;
    const [under, over] = node.querySelectorAll("img"), bar = node.querySelector(".bar"), input = node.querySelector("input");
    const move = () => {
      const share = input.value / 10;
      over.style.clipPath = `inset(0 ${100 - share}% 0 0)`;
      bar.style.left = share + "%";
      input.setAttribute("aria-valuetext", `${Math.round(share)} % A`);
    };
    input.addEventListener("input", move);
    node.addEventListener("pointerdown", (event) => { follow(event); input.focus({ preventScroll: true }); });
    node.addEventListener("pointermove", (event) => { if (event.buttons || event.pointerType === "mouse") follow(event); });
    const follow = (event) => {
      const box = node.getBoundingClientRect();
      input.value = Math.round((1000 * (event.clientX - box.left)) / box.width);
      move();
    };
    move();
    return (a, b, nameA, nameB) => {
      [over.src, under.src, over.alt, under.alt] = [pictures[a], pictures[b], nameA, nameB];
      node.querySelector(".left").textContent = nameA;
      node.querySelector(".rightname").textContent = nameB;
    };
  };

  const REFERENCE = "reference";
  const compared = splitter(at("split"), "Part of the picture that shows A");
  const imageOf = (value) => {
    if (value === REFERENCE) return data.reference;
    return points[value][state.kind] ?? points[value].picture ?? data.reference;
  };
  const compare = () => {
    const [a, b] = [at("a").value, at("b").value];
    const name = (v) => (v === REFERENCE ? "reference" : points[v].name);
    compared(imageOf(a), imageOf(b), "A: " + name(a), "B: " + name(b));
    at("figures-a").innerHTML = figures(points[a]);
    at("figures-b").innerHTML = figures(points[b]);
    for (const node of document.querySelectorAll("[data-legend]")) node.hidden = node.dataset.legend !== state.kind;
  };
  const choose = (index, place) => {
    if (place === undefined) {
      if (state.chosen.includes(index)) return;
      place = state.chosen.length < 2 ? state.chosen.length : (state.turn = 1 - (state.turn ?? 1));
    }
    state.chosen[place] = index;
    if (place === 1 && state.chosen[0] === undefined) state.chosen[0] = +at("a").value || 0;
    at("ab"[place]).value = index;
    draw();
    compare();
  };
  const option = (value, name) => `<option value="${value}">${escape(name)}</option>`;
  const all = points.map((p, k) => option(k, `${p.name}, ${text(p.costs.ms)} ms, ${text(p.errors.pixels_p99)} px`)).join("");
  for (const place of [0, 1]) {
    const node = at("ab"[place]);
    node.innerHTML = all + option(REFERENCE, "reference");
    node.addEventListener("change", () => {
      if (node.value !== REFERENCE) choose(+node.value, place);
      else { state.chosen = state.chosen.filter((_, k) => k !== place); draw(); compare(); }
    });
  }
  for (const node of document.querySelectorAll("[name=kind]"))
    node.addEventListener("change", () => { state.kind = node.value; compare(); });
  at("as-a").addEventListener("click", () => choose(state.now, 0));
  at("as-b").addEventListener("click", () => choose(state.now, 1));
  at("copy").addEventListener("click", async () => {
    const code = at("code").textContent;
    try { await navigator.clipboard.writeText(code); at("copy").textContent = "Copied"; } catch {
      getSelection().selectAllChildren(at("code"));
      at("copy").textContent = "Selected";
    }
    setTimeout(() => (at("copy").textContent = "Copy"), 1500);
  });

  // Axes and filters

  for (const [id, table] of [["error", errors], ["cost", costs]]) {
    at(id).innerHTML = Object.entries(table).map(([key, d]) => option(key, d.label)).join("");
    at(id).value = state[id];
    at(id).addEventListener("change", () => { state[id] = at(id).value; draw(); });
  }
  for (const [id, of] of [["tracers", (p) => p.tracer], ["schedules", (p) => p.schedule], ["changes", group]]) {
    for (const value of [...new Set(points.map(of))]) {
      const label = document.createElement("label"), box = document.createElement("input");
      Object.assign(box, { type: "checkbox", checked: true });
      box.addEventListener("change", () => { state.hidden[id][box.checked ? "delete" : "add"](value); draw(); });
      label.append(box, " " + (value === "single" ? "none" : value));
      at(id).append(label);
    }
  }
  at("legend").innerHTML = [...new Set(points.map((p) => p.tracer))].map((tracer) =>
    `<li><svg viewBox="-9 -7 18 14" aria-hidden="true"><path d="${shape(tracer)}" fill="${color(tracer)}"/></svg> ${escape(tracer)}</li>`).join("") +
    '<li><svg viewBox="0 0 18 14" aria-hidden="true"><path class="front" d="M1,2H9V11H17"/></svg> front: nothing measured is both cheaper and more accurate</li>';

  // Effects

  if (data.effects.length) {
    const shown = splitter(at("effect-split"), "Part of the picture that shows the scene with the effect");
    const most = Math.max(...data.effects.map((e) => e.interval[1]), 1e-9), gain = Math.max(...data.effects.map((e) => e.flip), 1e-9);
    const pick = (index) => {
      const e = data.effects[index];
      shown(e.with, e.without, "with " + e.name, "without");
      at("effect-figures").innerHTML = `<strong>${escape(e.name)}</strong>: ${text(e.ms)} ms a frame (${text(e.interval[0])} to ${text(e.interval[1])}), ` +
        `${Math.round(100 * e.share)} % of it; ${text(e.evaluations, 3)} evaluations per camera ray; ${text(e.shader_bytes)} bytes of shader; mean FLIP ${text(e.flip)}`;
      at("bars").querySelectorAll("button").forEach((b, k) => b.setAttribute("aria-pressed", k === index));
    };
    const cost = (e) => (e.interval[0] > 0 ? `costs ${text(e.ms)} ms, ${Math.round(100 * e.share)} %` : "no certain cost");
    const share = (v, of) => 100 * Math.min(Math.max(v / of, 0), 1);
    at("bars").innerHTML = data.effects.map((e, k) => `<button type="button" class="effect" data-k="${k}"><span class="title">${escape(e.name)}</span>` +
      `<span class="meter cost"><span class="track"><i style="width:${share(e.ms, most)}%"></i><u style="left:${share(e.interval[0], most)}%;width:${share(e.interval[1], most) - share(e.interval[0], most)}%"></u></span><span>${cost(e)}</span></span>` +
      `<span class="meter gain"><span class="track"><i style="width:${share(e.flip, gain)}%"></i></span><span>gives FLIP ${text(e.flip)}</span></span></button>`).join("");
    at("bars").addEventListener("click", (event) => { const b = event.target.closest("button"); if (b) pick(+b.dataset.k); });
    pick(0);
  }

  // Buttons that show a setting; tables

  document.addEventListener("click", (event) => {
    const node = event.target.closest("[data-show]");
    if (!node) return;
    show(+node.dataset.show);
    if (node.tagName === "BUTTON") at("explore").scrollIntoView({ block: "start" });
  });
  for (const table of document.querySelectorAll("table.sortable")) {
    const body = table.tBodies[0];
    const value = (row, k) => {
      const cell = row.cells[k].textContent.trim(), number = parseFloat(cell);
      return Number.isNaN(number) ? cell : number;
    };
    table.tHead.addEventListener("click", (event) => {
      const head = event.target.closest("th");
      if (!head) return;
      const k = head.cellIndex, up = head.getAttribute("aria-sort") !== "ascending";
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const rows = [...body.rows].sort((a, b) => {
        const x = value(a, k), y = value(b, k);
        if (typeof x !== typeof y) return typeof x === "number" ? -1 : 1; // text sorts last
        return (x < y ? -1 : x > y ? 1 : 0) * (up ? 1 : -1);
      });
      body.append(...rows);
    });
  }

  const first = points.findIndex((p) => p.bound === 0.5), last = points.findIndex((p) => p.finest);
  const a = Math.max(first, 0), own = Math.max(last, 0);
  const other = points.findIndex((p, k) => p.preset && k !== a); // one setting may be all answers
  show(a, false);
  state.chosen = [a, own === a && other >= 0 ? other : own];
  at("a").value = state.chosen[0];
  at("b").value = state.chosen[1];
  draw();
  compare();
  new ResizeObserver(draw).observe(svg.parentElement);
  window.raymarch = { state, show, choose, draw };
})();
