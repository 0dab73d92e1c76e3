// Small plots on canvases, drawn in a few milliseconds, so that the motion appears with the click.
window.Plots = (() => {
  "use strict";
  const STEPS = [1, 2, 5, 10];
  const UNIT = /^(.*?)(?: \[(.*)\])?$/;  // of an axis label: what it is, its unit
  // The page's colours, in which plots are drawn; they change with the system's dark or light mode.
  const LOOK = {}, draws = [], dark = window.matchMedia("(prefers-color-scheme: dark)");
  const dress = () => {
    const style = getComputedStyle(document.documentElement);
    for (const name of ["ink", "soft", "frame", "grid", "paper", "wall", "stripes", "empty", "blue", "red", "green"]) LOOK[name] = style.getPropertyValue(`--${name}`);
    redraw();
  };
  const redraw = () => { for (const draw of draws) draw(); };
  dress();
  dark.addEventListener("change", dress);
  const minus = (text) => text.replace(/-/g, "−");

  // Unit prefixes as in the package's figures, for values from 0.1 to 100; powers of ten for other units.
  const PREFIXES = { "-15": "f", "-12": "p", "-9": "n", "-6": "µ", "-3": "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T" };
  const PREFIXED = /^(m|s|N|J|g|Hz|Pa|W)(?=$|[ /])/;
  const power_of = (size) => (!size || !Number.isFinite(size) || (size >= 0.01 && size < 1e5) ? 0 : 3 * Math.floor((Math.log10(size) + 1) / 3));
  const scaled_unit = (unit, power) => {
    if (!power) return unit;
    const [base, ten] = unit === "kg" && power < 0 ? ["g", power + 3] : [unit, power];
    if (PREFIXED.test(base) && ten in PREFIXES) return PREFIXES[ten] + base;
    return `10${[...String(power)].map((one) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(one)]).join("")} ${unit}`.trim();
  };
  // A value with its unit, with the given power of ten or a suitable one.
  const quantity = (value, unit, digits, power = power_of(Math.abs(value))) => {
    const text = (value / 10 ** power).toPrecision(digits), scaled = scaled_unit(unit, power);
    return minus(`${String(Number(text))}${/^10./.test(scaled) ? " · " : scaled ? " " : ""}${scaled}`);
  };

  // A value in practical units, such as Hz and rpm; "" if it is practical already or may have no unit.
  const also = (value, unit = "") => {
    if (unit === "rad/s" && value >= 2 * Math.PI) {
      const turns = value / (2 * Math.PI);
      return `${quantity(turns, "Hz", 4, 0)}, ${quantity(60 * turns, "rpm", 4, 0)}`;
    }
    const size = Math.abs(value), base = unit.replace(/^N\/m²$/, "Pa");
    if (!size || (size >= 0.01 && size < 1e5) || !(PREFIXED.test(base) || (unit === "kg" && size < 1))) return "";
    return quantity(value, base, 4, unit === "m" && size > 1e-6 ? -3 : 3 * Math.floor(Math.log10(size) / 3 + 1e-9));
  };

  // Round places within [low, high], and how to write them in units of a power of ten; values far from zero are counted
  // from a round base.
  const ticks = (low, high, room) => {
    const span = high - low, size = Math.max(Math.abs(low), Math.abs(high));
    if (!(span > 0) || !Number.isFinite(size)) return { at: [], word: String, base: 0, power: 0 };
    const ten = 10 ** Math.floor(Math.log10(span / Math.max(room, 1)));
    const step = ten * STEPS.find((one) => ten * one >= 0.7 * span / Math.max(room, 1));
    const base = size / span > 1e4 ? Number((0.5 * (low + high)).toPrecision(Math.ceil(Math.log10(size / span)))) : 0;
    const at = [];
    for (let k = Math.ceil((low - base) / step); k * step <= high - base && at.length < 50; k++) at.push(k * step);
    const power = power_of(Math.max(Math.abs(low - base), Math.abs(high - base))), unit = 10 ** power;
    const digits = Math.max(0, -Math.floor(Math.log10(step / unit) + 1e-9));
    const word = (value) => minus(((value - base) / unit).toFixed(digits).replace(/^-(0\.?0*)$/, "$1"));
    return { at: at.map((value) => base + value), word, base, power };
  };

  class Plot {
    // `paint(plot)` draws what the plot is about, in its units; `fixed` are pixels left and right of the frame; `still`
    // plots neither pan nor zoom; `clicked(place)` and `moved()` are called when a person acts.
    constructor(id, { title = "", x, y, paint, fixed = null, still = false, clicked = () => {}, moved = () => {} }) {
      Object.assign(this, { x, y, title, paint, fixed, still, clicked, moved, held: null, deepest: 1e-7 });
      this.canvas = document.getElementById(id);
      this.pen = this.canvas.getContext("2d");
      this.place = this.canvas.parentElement.appendChild(document.createElement("output"));
      this.home = { x: [0, 1], y: [0, 1] };
      this.reset();
      draws.push(() => this.draw());
      new ResizeObserver(() => this.draw()).observe(this.canvas);
      this.listen();
    }

    reset() { this.range = { x: [...this.home.x], y: [...this.home.y] }; }

    fit(x, y) { this.home = { x: [...x], y: [...y] }; this.reset(); }

    // The visible ranges as four numbers; nothing if all is visible.
    get part() {
      const all = ["x", "y"].every((axis) => this.range[axis].every((end, k) => end === this.home[axis][k]));
      return all ? null : [...this.range.x, ...this.range.y];
    }

    show([left, right, low, high]) { this.range = { x: [left, right], y: [low, high] }; this.draw(); }

    // ---- user input
    listen() {
      const { canvas } = this;
      canvas.addEventListener("pointerdown", (event) => {
        if (event.button) return;
        this.held = { x: event.offsetX, y: event.offsetY, range: structuredClone(this.range), box: event.shiftKey, far: false };
        canvas.setPointerCapture(event.pointerId);
      });
      canvas.addEventListener("pointermove", (event) => { this.drag(event); this.tell(event); });
      canvas.addEventListener("pointerup", (event) => {
        const held = this.held;
        this.held = null;
        if (!held) return;
        if (!held.far) { if (this.inside(event)) this.clicked(this.at(event)); return; }
        if (held.box) this.range = this.boxed(held, event);
        this.draw();
        this.moved();
      });
      canvas.addEventListener("pointercancel", () => { this.held = null; });
      canvas.addEventListener("pointerleave", () => { this.place.textContent = ""; });
      if (this.still) return;
      canvas.addEventListener("dblclick", () => { this.reset(); this.draw(); this.moved(); });
      canvas.addEventListener("keydown", (event) => this.press(event));
      canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.zoom(1.2 ** Math.sign(event.deltaY), this.at(event)); }, { passive: false });
    }

    // Arrows pan, + and − zoom, Home resets; keys handled by the plot do not reach the page.
    press(event) {
      const { key } = event, { x, y } = this.range, middle = { x: (x[0] + x[1]) / 2, y: (y[0] + y[1]) / 2 };
      const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[key];
      const factor = { "+": 1 / 1.2, "=": 1 / 1.2, "-": 1.2 }[key];
      if (event.ctrlKey || event.metaKey || event.altKey || !(step || factor || key === "Home")) return;
      event.preventDefault();
      event.stopPropagation();
      if (factor) { this.zoom(factor, middle); return; }
      if (step) this.range = { x: x.map((one) => one + step[0] * (x[1] - x[0])), y: y.map((one) => one + step[1] * (y[1] - y[0])) };
      else this.reset();
      this.draw();
      this.moved();
    }

    drag(event) {
      const { held } = this;
      if (!held || this.still) return;
      held.far = held.far || Math.hypot(event.offsetX - held.x, event.offsetY - held.y) > 3;
      if (!held.far) return;
      held.now = [event.offsetX, event.offsetY];
      if (!held.box) {
        const { x, y } = held.range, across = (event.offsetX - held.x) / this.width * (x[1] - x[0]);
        const up = (held.y - event.offsetY) / this.height * (y[1] - y[0]);
        this.range = { x: x.map((one) => one - across), y: y.map((one) => one - up) };
      }
      this.draw();
    }

    boxed(held, event) {
      const from = this.at({ offsetX: held.x, offsetY: held.y }), to = this.at(event);
      return { x: [from.x, to.x].sort((a, b) => a - b), y: [from.y, to.y].sort((a, b) => a - b) };
    }

    zoom(factor, at) {
      const range = {};
      for (const axis of ["x", "y"]) {
        range[axis] = this.range[axis].map((end) => at[axis] + (end - at[axis]) * factor);
        const [low, high] = range[axis], size = Math.max(Math.abs(low), Math.abs(high));
        if (high - low < this.deepest * size || high - low > 1e3 * (this.home[axis][1] - this.home[axis][0])) return;
      }
      this.range = range;
      this.draw();
      this.moved();
    }

    at(event) {
      const { x, y } = this.range;
      return { x: x[0] + (event.offsetX - this.left) / this.width * (x[1] - x[0]), y: y[1] - (event.offsetY - this.top) / this.height * (y[1] - y[0]) };
    }

    inside(event) {
      const right = event.offsetX - this.left, down = event.offsetY - this.top;
      return right >= 0 && right <= this.width && down >= 0 && down <= this.height;
    }

    // A value with its unit, with as many digits as its axis resolves.
    written(axis, value) {
      const [low, high] = this.range[axis], apart = Math.max(Math.abs(low), Math.abs(high)) / (high - low);
      const power = apart > 1e4 ? 0 : power_of(Math.max(Math.abs(low), Math.abs(high)));  // as its ticks
      return quantity(value, this[axis].match(UNIT)[2] || "", Math.min(Math.max(Math.ceil(Math.log10(apart)) + 4, 4), 17), power);
    }

    tell(event) {
      const at = this.at(event);
      this.place.textContent = this.inside(event) ? `${this.written("x", at.x)}, ${this.written("y", at.y)}` : "";
    }

    // ---- drawing
    px(x) { return this.left + (x - this.range.x[0]) / (this.range.x[1] - this.range.x[0]) * this.width; }

    py(y) { return this.top + (this.range.y[1] - y) / (this.range.y[1] - this.range.y[0]) * this.height; }

    draw() {
      const { canvas, pen } = this, ratio = LOOK.ratio || window.devicePixelRatio || 1, wide = canvas.clientWidth, high = canvas.clientHeight;
      if (!wide || !high) return;
      const [w, h] = [Math.round(wide * ratio), Math.round(high * ratio)];
      if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.fillStyle = LOOK.paper;
      pen.fillRect(0, 0, wide, high);
      const letter = window.innerWidth >= 1700 ? 13 : 11;
      pen.font = `${letter}px Arial, Helvetica, sans-serif`;
      this.top = this.title ? letter + 10 : 6;
      this.height = Math.max(high - this.top - 2 * letter - 16, 1);
      const rows = ticks(...this.range.y, this.height / 32), words = rows.at.map(rows.word);
      const labels = Math.max(0, ...words.map((word) => pen.measureText(word).width));
      const more = 5 * (letter - 11);
      this.left = this.fixed ? this.fixed[0] + more : labels + letter + 18;
      this.width = Math.max(wide - this.left - (this.fixed ? this.fixed[1] + more : 12), 1);
      let columns = ticks(...this.range.x, this.width / 56);
      const widest = Math.max(1, ...columns.at.map((x) => pen.measureText(columns.word(x)).width));
      if (columns.at.length * (widest + 10) > this.width) columns = ticks(...this.range.x, 0.7 * this.width / (widest + 10));
      this.frame(columns, rows, words, letter, high);
      pen.save();
      pen.beginPath();
      pen.rect(this.left, this.top, this.width, this.height);
      pen.clip();
      this.paint(this);
      if (this.held && this.held.box && this.held.now) {
        Object.assign(pen, { strokeStyle: LOOK.ink, lineWidth: 1, fillStyle: "rgba(255, 255, 255, .3)" });
        const box = [this.held.x, this.held.y, this.held.now[0] - this.held.x, this.held.now[1] - this.held.y];
        pen.fillRect(...box);
        pen.strokeRect(...box);
      }
      pen.restore();
    }

    frame(columns, rows, words, letter, high) {
      const { pen, left, top, width, height } = this, bottom = top + height, sharp = (value) => Math.round(value) + 0.5;
      const stroke = (color, path) => { pen.strokeStyle = color; pen.lineWidth = 1; pen.beginPath(); path(); pen.stroke(); };
      const label = (text, { base, power }) => {
        const [, name, unit = ""] = text.match(UNIT), scaled = scaled_unit(unit, power);
        return `${name}${base ? ` − ${minus(String(base))}${power && unit ? ` ${unit}` : ""}` : ""}${scaled ? ` [${scaled}]` : ""}`;
      };
      stroke(LOOK.grid, () => {
        for (const x of columns.at) { pen.moveTo(sharp(this.px(x)), top); pen.lineTo(sharp(this.px(x)), bottom); }
        for (const y of rows.at) { pen.moveTo(left, sharp(this.py(y))); pen.lineTo(left + width, sharp(this.py(y))); }
      });
      stroke(LOOK.frame, () => {
        pen.moveTo(sharp(left), top); pen.lineTo(sharp(left), sharp(bottom)); pen.lineTo(left + width, sharp(bottom));
        for (const x of columns.at) { pen.moveTo(sharp(this.px(x)), bottom); pen.lineTo(sharp(this.px(x)), bottom + 5); }
        for (const y of rows.at) { pen.moveTo(left, sharp(this.py(y))); pen.lineTo(left - 5, sharp(this.py(y))); }
      });
      pen.fillStyle = LOOK.ink;
      pen.textAlign = "center";
      pen.textBaseline = "top";
      for (const x of columns.at) pen.fillText(columns.word(x), this.px(x), bottom + 7);
      // in the middle of its axis, or as near as the canvas allows
      const middle = (text, center, whole) => {
        const half = pen.measureText(text).width / 2 + 2;
        return Math.max(Math.min(center, whole - half), half);
      };
      const across = label(this.x, columns), upwards = label(this.y, rows);
      pen.fillText(across, middle(across, left + width / 2, this.canvas.clientWidth), high - letter - 2);
      pen.textBaseline = "middle";
      pen.textAlign = "right";
      rows.at.forEach((y, k) => pen.fillText(words[k], left - 8, this.py(y)));
      pen.textAlign = "left";
      const room = this.canvas.clientWidth - pen.measureText(this.title).width - 2;
      if (this.title) pen.fillText(this.title, Math.max(Math.min(left, room), 2), letter / 2 + 4);
      pen.save();
      pen.translate(letter / 2 + 2, middle(upwards, top + height / 2, high));
      pen.rotate(-Math.PI / 2);
      pen.textAlign = "center";
      pen.fillText(upwards, 0, 0);
      pen.restore();
    }

    line(x, y, color, width = 1.4, from = 0, to = x.length) {
      const { pen } = this;
      Object.assign(pen, { strokeStyle: color, lineWidth: width, lineJoin: "round" });
      pen.beginPath();
      for (let k = from; k < to; k++) pen.lineTo(this.px(x[k]), this.py(y[k]));
      pen.stroke();
    }

    dots(x, y, color, size = 4) {
      const { pen } = this, half = size / 2, seen = new Set();
      pen.fillStyle = color;
      pen.beginPath();
      for (let k = 0; k < x.length; k++) {
        const a = this.px(x[k]), b = this.py(y[k]), place = Math.round(2 * a) * 16384 + Math.round(2 * b);
        if (seen.has(place)) continue;  // a cycle comes back to the same places
        seen.add(place);
        if (size < 2) pen.fillRect(a - half, b - half, size, size);
        else { pen.moveTo(a + half, b); pen.arc(a, b, half, 0, 7); }
      }
      pen.fill();
    }

    // Small triangles that point down at positions.
    marks(x, y, color) {
      const { pen } = this;
      Object.assign(pen, { fillStyle: color, strokeStyle: LOOK.paper, lineWidth: 1 });
      pen.beginPath();
      let last = -Infinity;
      for (let k = 0; k < x.length; k++) {
        const a = this.px(x[k]), b = this.py(y[k]);
        if (Number.isNaN(b) || a - last < 2 || a < this.left - 4 || a > this.left + this.width + 4) continue;  // a chatter has thousands of them
        pen.moveTo(a - 4, b - 3); pen.lineTo(a + 4, b - 3); pen.lineTo(a, b + 4); pen.lineTo(a - 4, b - 3);
        last = a;
      }
      pen.stroke();
      pen.fill();
    }

    // Thick strokes from begin to end, each along a height.
    bars(begin, end, y, color) {
      const { pen } = this;
      Object.assign(pen, { strokeStyle: color, lineWidth: 5 });
      pen.beginPath();
      for (let k = 0; k < begin.length; k++) { pen.moveTo(this.px(begin[k]), this.py(y[k])); pen.lineTo(this.px(end[k]), this.py(y[k])); }
      pen.stroke();
    }

    // A line through the whole frame at a value of an axis.
    rule(axis, value, color, dash = []) {
      const { pen } = this;
      Object.assign(pen, { strokeStyle: color, lineWidth: 1.2 });
      pen.setLineDash(dash);
      pen.beginPath();
      if (axis === "x") { pen.moveTo(this.px(value), this.top); pen.lineTo(this.px(value), this.top + this.height); }
      else { pen.moveTo(this.left, this.py(value)); pen.lineTo(this.left + this.width, this.py(value)); }
      pen.stroke();
      pen.setLineDash([]);
    }

    // The face of another motion's stop.
    face(gap, across, color, side = 1) {
      this.rule(across ? "y" : "x", gap, color);
      const { pen, left, top, width, height } = this, at = across ? this.py(gap) : this.px(gap);
      pen.beginPath();
      for (let k = 0; k < (across ? width : height); k += 7) {
        if (across) { pen.moveTo(left + k, at); pen.lineTo(left + k + 5, at - 5 * side); }
        else { pen.moveTo(at, top + k + 5); pen.lineTo(at + 5 * side, top + k); }
      }
      pen.stroke();
    }

    // The region behind a stop: above it over time, right of it in phase plots; for a stop on the other side (-1), the opposite.
    stop(gap, across, side = 1) {
      const { pen } = this, at = across ? this.py(gap) : this.px(gap), higher = (side > 0) !== across;
      const ends = across ? [this.top, this.top + this.height] : [this.left, this.left + this.width];
      const [from, to] = higher ? [Math.max(at, ends[0]), ends[1]] : [ends[0], Math.min(at, ends[1])];
      if (!(from < to)) return;
      const [x, right] = across ? [this.left, this.left + this.width] : [from, to];
      const [top, bottom] = across ? [from, to] : [this.top, this.top + this.height];
      pen.save();
      pen.beginPath();
      pen.rect(x, top, right - x, bottom - top);
      pen.clip();
      pen.fillStyle = LOOK.wall;
      pen.fillRect(x, top, right - x, bottom - top);
      Object.assign(pen, { strokeStyle: LOOK.stripes, lineWidth: 1 });
      pen.beginPath();
      const tall = bottom - top;
      for (let a = x - tall - ((x - tall) % 6); a < right; a += 6) { pen.moveTo(a, bottom); pen.lineTo(a + tall, top); }
      pen.stroke();
      pen.restore();
    }
  }

  // margins in pixels of the plane and the diagram below it, whose x axes are aligned
  const MARGINS = [62, 66];

  return { Plot, LOOK, MARGINS, UNIT, also, draws, minus, quantity, power_of, redraw };
})();
