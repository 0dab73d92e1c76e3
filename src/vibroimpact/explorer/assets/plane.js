// The plane: an image with one value per pair of parameters, and its overlays.
window.Plane = (() => {
  "use strict";
  const { Plot, LOOK, MARGINS, UNIT, also, quantity } = window.Plots;
  const INK = "#222", REST = 150, HOVER = 60;  // ms from the last wheel event to the command; ms before the tooltip
  let picture = null, curves = { lengths: [], places: [], colors: [], words: [] }, pending = null;
  let marks = { x: 0, y: 0, along: "x", pins: [] };
  let names = { x: "", y: "" }, hovering = null, hatch = { side: 0, speeds: [] };
  const canvas = () => document.createElement("canvas");
  const tip = document.getElementById("tip"), image = canvas(), mask = canvas(), stripes = canvas();

  const disc = (pen, x, y, radius, fill, edge, width) => {
    Object.assign(pen, { fillStyle: fill, strokeStyle: edge, lineWidth: width });
    pen.beginPath(); pen.arc(x, y, radius, 0, 7);
    if (fill) pen.fill();
    pen.stroke();
  };
  const cross = (pen, x, y, color, width) => {
    disc(pen, x, y, 7.5, null, color, width);
    pen.beginPath();
    pen.moveTo(x - 7.5, y); pen.lineTo(x + 7.5, y); pen.moveTo(x, y - 7.5); pen.lineTo(x, y + 7.5);
    pen.stroke();
  };
  // Stripes over the cells of the mask, equally spaced on the screen at any zoom.
  const STEP = 7;
  const draw_hatch = (plot, left, top, width, height) => {
    const { pen } = plot, { a: ratio } = pen.getTransform(), brush = stripes.getContext("2d");
    [stripes.width, stripes.height] = [plot.left + plot.width, plot.top + plot.height].map((size) => Math.ceil(size * ratio));
    brush.scale(ratio, ratio);
    brush.imageSmoothingEnabled = false;
    brush.drawImage(mask, left, top, width, height);
    brush.globalCompositeOperation = "source-in";
    Object.assign(brush, { strokeStyle: INK, lineWidth: 1 });
    brush.beginPath();
    const bottom = plot.top + plot.height, tall = plot.height;
    for (let x = plot.left - tall; x < plot.left + plot.width; x += STEP) { brush.moveTo(x, bottom); brush.lineTo(x + tall, plot.top); }
    brush.stroke();
    pen.drawImage(stripes, 0, 0, stripes.width / ratio, stripes.height / ratio);
  };
  const each_curve = (draw) => {
    let at = 0;
    curves.lengths.forEach((length, number) => { draw(at, at + length, number); at += length; });
  };
  const paint = (plot) => {
    const { pen } = plot;
    pen.fillStyle = LOOK.empty;
    pen.fillRect(plot.left, plot.top, plot.width, plot.height);
    if (picture) {
      const { x, y } = picture, left = plot.px(x[0]), top = plot.py(y[1]);
      pen.imageSmoothingEnabled = false;
      const size = [plot.px(x[1]) - left, plot.py(y[0]) - top];
      pen.drawImage(image, left, top, ...size);
      if (hatch.side) draw_hatch(plot, left, top, ...size);
    }
    for (const wide of [3.1, 1.7]) each_curve((from, to, number) => {
      const [color, halo] = curves.colors[number];
      Object.assign(pen, { strokeStyle: wide > 2 ? halo : color, lineWidth: wide, lineJoin: "round" });
      pen.beginPath();
      for (let k = from; k < to; k++) pen.lineTo(plot.px(curves.places[2 * k]), plot.py(curves.places[2 * k + 1]));
      pen.stroke();
    });
    plot.rule(marks.along === "x" ? "y" : "x", marks.along === "x" ? marks.y : marks.x, "#fff", [6, 4]);
    for (const [x, y, color, letter] of marks.pins) {
      disc(pen, plot.px(x), plot.py(y), 8.5, color, "#fff", 1.5);
      Object.assign(pen, { fillStyle: "#000", textAlign: "center", textBaseline: "middle", font: "bold 11px Arial, sans-serif" });
      pen.fillText(letter, plot.px(x), plot.py(y) + 0.5);
    }
    for (const [color, width] of [["#fff", 4], [INK, 1.8]]) cross(pen, plot.px(marks.x), plot.py(marks.y), color, width);
  };

  class PlanePlot extends Plot {
    draw() {
      super.draw();
      if (picture && picture.ticks.length && this.height > 20) this.bar();
    }

    // The colour bar beside the plane.
    bar() {
      const { pen, top, height } = this, { scale: colors, ticks, low, high } = picture, left = this.left + this.width + 6, step = height / colors.length;
      colors.forEach((color, number) => { pen.fillStyle = color; pen.fillRect(left, top + height - (number + 1) * step, 10, step + 0.6); });
      Object.assign(pen, { fillStyle: LOOK.ink, textAlign: "left", textBaseline: "middle" });
      for (const [value, word] of ticks) {
        const y = top + height * (high - value) / (high - low);
        pen.fillRect(left + 10, y - 0.5, 3, 1);
        pen.fillText(word, left + 16, y);
      }
    }

    press() {}  // the page handles keys: they move the point and zoom the plane

    // A quick click must not wait for the tooltip.
    tell({ offsetX, offsetY }) {
      clearTimeout(hovering);
      if (!tip.hidden) this.describe({ offsetX, offsetY });
      else hovering = setTimeout(() => this.describe({ offsetX, offsetY }), HOVER);
    }

    describe(event) {
      const lines = this.inside(event) && !this.held ? this.words(event) : [];
      tip.hidden = !lines.length;
      if (!lines.length) return;
      tip.replaceChildren(...lines.map((line) => Object.assign(document.createElement("div"), { textContent: line })));
      tip.style.maxWidth = `${this.width}px`;
      tip.style.transform = `translate(${this.beside(event, tip.offsetWidth, tip.offsetHeight).join("px, ")}px)`;
    }

    // The nearest position within the frame where the tooltip hides neither the cell nor, if there is room, point and pins.
    beside({ offsetX: x, offsetY: y }, wide, high) {
      const kept = [[x, y, 14, 1e6], ...[[marks.x, marks.y], ...marks.pins].map(([a, b]) => [this.px(a), this.py(b), 10, 1e4])];
      const rights = [this.left, this.left + this.width - wide], downs = [this.top, this.top + this.height - high];
      for (const [a, b, far] of kept) { rights.push(a + far, a - far - wide); downs.push(b + far, b - far - high); }
      let best = [rights[0], downs[0]], least = Infinity;
      for (const right of rights) for (const down of downs) {
        if (right < rights[0] || right > rights[1] || down < downs[0] || down > downs[1]) continue;
        const covers = ([a, b, far]) => a + far > right && a - far < right + wide && b + far > down && b - far < down + high;
        const cost = kept.reduce((sum, one) => sum + one[3] * covers(one), 0) + Math.hypot(right + wide / 2 - x, down + high / 2 - y);
        if (cost < least) { least = cost; best = [right, down]; }
      }
      return best;
    }

    words(event) {
      const at = this.at(event), told = (axis) => {
        const unit = this[axis].match(UNIT)[2], more = unit === "rad/s" ? also(at[axis], unit) : "";  // others have prefixes
        return `${names[axis]} ${this.written(axis, at[axis])}${more ? ` (${more})` : ""}`;
      };
      const lines = [told("x"), told("y")];
      const near = this.nearest(event);
      if (near) lines.push(near);
      if (!picture) return lines;
      const [rows, columns] = picture.shape, { x, y } = picture;
      const column = Math.floor((at.x - x[0]) / (x[1] - x[0]) * columns), row = Math.floor((at.y - y[0]) / (y[1] - y[0]) * rows);
      if (column < 0 || column >= columns || row < 0 || row >= rows) return lines;
      const value = picture.values[row * columns + column];
      if (picture.index && !Number.isNaN(value)) lines.push(`${picture.index} ${Number.isFinite(value) ? quantity(value, picture.unit, 9) : value < 0 ? "−∞" : "none"}`);
      lines.push(`${picture.origin}: ${picture.motions[picture.names[row * columns + column]]}`);
      const other = hatch.speeds[Math.floor((row + 0.5) / rows * hatch.side) * hatch.side + Math.floor((column + 0.5) / columns * hatch.side)];
      if (other > 0) lines.push(`from another initial condition: impacts of up to ${quantity(other, "m/s", 3)}`);
      return lines;
    }

    // The description of the boundary below the pointer.
    nearest(event) {
      let best = 25, word = "";
      each_curve((from, to, number) => {
        for (let k = from; k < to; k++) {
          const across = this.px(curves.places[2 * k]) - event.offsetX, down = this.py(curves.places[2 * k + 1]) - event.offsetY;
          if (across * across + down * down < best) { best = across * across + down * down; word = curves.words[number]; }
        }
      });
      return word;
    }
  }

  let report = () => {};
  const plot = new PlanePlot("plane-canvas", {
    x: "", y: "", fixed: MARGINS, paint,
    clicked: ({ x, y }) => report(`click ${x} ${y}`),
    moved: () => {
      clearTimeout(pending);
      pending = setTimeout(() => { pending = null; report(`zoom ${[...plot.range.x, ...plot.range.y].join(" ")}`); }, REST);
    },
  });
  plot.deepest = 0;  // the server says where double precision ends
  for (const turning of ["pointerleave", "pointerdown"]) plot.canvas.addEventListener(turning, () => { clearTimeout(hovering); tip.hidden = true; });

  // "#rrggbb" as a picture holds it: red first, whatever the order of bytes
  const pixel = (color) => new Uint32Array(new Uint8Array([1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16)).concat(255)).buffer)[0];

  // ---- data from the server
  const takes = {
    plane: (content) => {
      const [rows, columns] = content.shape, colors = content.colors.map(pixel), pixels = new Uint32Array(rows * columns);
      picture = { ...content, scale: content.colors.slice(0, content.scale) };
      image.width = columns;
      image.height = rows;
      for (let k = 0; k < pixels.length; k++) pixels[k] = colors[content.cells[k]];
      image.getContext("2d").putImageData(new ImageData(new Uint8ClampedArray(pixels.buffer), columns, rows), 0, 0);
      window.explorer.planes.push([content.side, performance.now()]);
    },
    hatch: (content) => {
      hatch = content;
      const { side, speeds } = content;
      if (!side) return;
      mask.width = mask.height = side;
      const pixels = new ImageData(side, side);
      for (let k = 0; k < side * side; k++) {
        const row = Math.floor(k / side);
        if (speeds[k] > 0) pixels.data[4 * ((side - 1 - row) * side + k % side) + 3] = 255;
      }
      mask.getContext("2d").putImageData(pixels, 0, 0);
    },
    plane_home: ({ x, y, labels, symbols }) => {
      [plot.x, plot.y] = labels;
      [names.x, names.y] = symbols;
      if (!plot.held && pending === null) plot.fit(x, y);
    },
    marks: (content) => { marks = content; },
    curves: (content) => { curves = content; },
  };
  const take = (parts) => {
    const mine = parts.filter(([name]) => name in takes);
    for (const [name, content] of mine) takes[name](content);
    if (mine.length) plot.draw();
  };
  return { take, listen: (send) => { report = send; }, plot };
})();
