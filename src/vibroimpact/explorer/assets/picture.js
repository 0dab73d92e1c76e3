// The view as a picture: plane and motion as on the page, drawn at twice the size.
window.Picture = (() => {
  "use strict";
  const SCALE = 2, PARTS = "#plane, #point", LEFT_OUT = "button, select, output, #tip";
  const { LOOK } = window.Plots;

  // Text at its position on the page, clipped as on the page.
  const write = (pen, root) => {
    const walker = document.createTreeWalker(root, NodeFilter.SHOW_TEXT), range = document.createRange();
    for (let node = walker.nextNode(); node; node = walker.nextNode()) {
      const parent = node.parentElement;
      if (parent.closest(LEFT_OUT) || !parent.checkVisibility()) continue;
      const style = getComputedStyle(parent), edge = parent.getBoundingClientRect();
      pen.save();
      pen.beginPath(); pen.rect(edge.x, edge.y, edge.width, edge.height); pen.clip();
      Object.assign(pen, { font: `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`, fillStyle: style.color, textBaseline: "middle" });
      for (const { 0: word, index } of node.textContent.matchAll(/\S+/g)) {
        range.setStart(node, index); range.setEnd(node, index + word.length);
        const { x, y, height } = range.getBoundingClientRect();
        pen.fillText(word, x, y + height / 2);
      }
      pen.restore();
    }
  };

  // Legend keys, and the lines below column headings.
  const mark = (pen, box) => {
    const { x, y, width, height } = box.getBoundingClientRect(), style = getComputedStyle(box), thick = parseFloat(style.borderBottomWidth);
    pen.fillStyle = style.borderBottomColor;
    if (!box.matches(".key")) { pen.fillRect(x, y + height - thick, width, thick); return; }
    pen.fillRect(x, y, width, height);
    pen.fillStyle = style.backgroundColor;
    pen.fillRect(x + 1, y + 1, width - 2, height - 2);
    if (!box.matches(".hatch")) return;
    Object.assign(pen, { strokeStyle: "#222", lineWidth: 1 });
    pen.beginPath();
    for (const k of [0.35, 0.7, 1]) { pen.moveTo(x, y + k * height); pen.lineTo(x + k * width, y); }
    pen.stroke();
  };

  const draw = () => {
    const roots = [...document.querySelectorAll(PARTS)], boxes = roots.map((one) => one.getBoundingClientRect());
    const [left, top] = ["left", "top"].map((side) => Math.min(...boxes.map((one) => one[side])));
    const [right, bottom] = ["right", "bottom"].map((side) => Math.max(...boxes.map((one) => one[side])));
    const sheet = document.createElement("canvas"), pen = sheet.getContext("2d");
    [sheet.width, sheet.height] = [right - left, bottom - top].map((size) => Math.round(SCALE * size));
    pen.scale(SCALE, SCALE);
    pen.translate(-left, -top);
    pen.fillStyle = LOOK.paper;
    pen.fillRect(left, top, right - left, bottom - top);
    LOOK.ratio = SCALE;
    window.Plots.redraw();
    for (const root of roots) {
      for (const canvas of root.querySelectorAll("canvas")) {
        const { x, y, width, height } = canvas.getBoundingClientRect();
        pen.drawImage(canvas, x, y, width, height);
      }
      for (const box of root.querySelectorAll(".key, .n td[style]")) mark(pen, box);
      write(pen, root);
    }
    delete LOOK.ratio;
    window.Plots.redraw();
    return sheet;
  };
  return { draw };
})();
