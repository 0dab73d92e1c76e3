// The parameters: a field and a slider for each.
window.Rows = (() => {
  "use strict";
  const STEPS = 500;  // steps of a slider
  const LEAST = 9;  // least width of a field in characters
  const { UNIT, also, minus } = window.Plots;
  let report = () => -1;

  class Row {
    constructor(name, label, logarithmic) {
      const make = (tag, content) => Object.assign(document.createElement(tag), content), inputs = { autocomplete: "off" };
      const field = make("input", { id: `number_${name}`, type: "text", inputMode: "decimal", maxLength: 40, spellcheck: false, ...inputs });
      const slider = make("input", { id: `slider_${name}`, type: "range", ariaLabel: label, ...inputs });
      Object.assign(this, { field, slider, logarithmic, shown: [0, 0, 1], typing: false, held: false, sent: -1 });
      this.box = make("div", {});
      this.box.dataset.name = name;
      this.box.append(make("label", { htmlFor: field.id, textContent: label }), field, slider);
      slider.max = STEPS;
      slider.addEventListener("input", () => { this.fill(); this.sent = report(`slide ${name} ${this.slid()}`); });
      slider.addEventListener("pointerdown", () => { this.held = true; });
      for (const end of ["pointerup", "pointercancel", "blur"]) slider.addEventListener(end, () => { this.held = false; this.place(); });
      field.addEventListener("input", () => { this.typing = field.value !== this.text; this.fit(); });
      field.addEventListener("change", () => { this.typing = false; this.sent = report(`type ${name} ${field.value.trim()}`); });
      field.addEventListener("blur", () => { if (this.typing) this.restore(); });  // typing without a change
      field.addEventListener("keydown", (event) => { if (event.key === "Escape") this.restore(); });
    }

    // The slider counts steps, so that both ends are reachable.
    slid() {
      const [, low, high] = this.ends, share = Number(this.slider.value) / STEPS;
      if (share === 1) return high;
      return this.logarithmic ? low * (high / low) ** share : low + share * (high - low);
    }

    get text() { return minus(String(this.shown[0])); }

    // A field is as wide as its content.
    fit() { this.field.style.width = `calc(${Math.max(this.field.value.length, LEAST)}ch + 14px)`; }

    fill() { this.slider.style.setProperty("--share", this.slider.value / STEPS); }

    restore() { this.typing = false; this.field.value = this.text; this.fit(); }

    show(shown) {
      this.shown = shown;
      if (!this.typing && this.field.value !== this.text) this.restore();
      this.place();
    }

    // While a slider is dragged, its ends do not change.
    place() {
      const [value, low, high] = this.shown, { slider } = this, label = this.box.querySelector("label");
      label.dataset.also = also(value, label.textContent.match(UNIT)[2]);
      if (!this.held) {
        this.ends = this.shown;
        const share = this.logarithmic ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
        const step = String(Math.round(share * STEPS));
        if (slider.value !== step) slider.value = step;
        this.fill();
      }
      slider.setAttribute("aria-valuetext", this.text);
    }
  }

  let rows = {}, made = "";
  // Another model has other parameters.
  const make_rows = (labels) => {
    if (made === String(labels)) return;
    made = String(labels);
    rows = Object.fromEntries(labels.map(([name, ...row]) => [name, new Row(name, ...row)]));
    document.getElementById("parameters").replaceChildren(...Object.values(rows).map(({ box }) => box));
  };
  // The server may answer an older message than the last one sent: a slider must not jump back while in use.
  const take = (parts) => {
    for (const [part, { heard, labels, values }] of parts) {
      if (part !== "rows") continue;
      make_rows(labels);
      for (const [name, shown] of Object.entries(values)) if (heard >= rows[name].sent) rows[name].show(shown);
    }
  };
  return { take, listen: (send) => { report = send; } };
})();
