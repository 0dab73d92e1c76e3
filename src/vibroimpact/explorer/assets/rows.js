// The parameters: a field and a slider for each.
window.Rows = (() => {
  "use strict";
  const STEPS = 500;
  let report = () => -1;

  class Row {
    constructor(box) {
      [this.field, this.slider] = box.querySelectorAll("input");
      Object.assign(this, { shown: [0, 0, 1], typing: false, held: false, sent: -1 });
      const { name } = box.dataset, { field, slider } = this;
      slider.max = STEPS;
      slider.addEventListener("input", () => { this.sent = report(`slide ${name} ${this.slid()}`); });
      slider.addEventListener("pointerdown", () => { this.held = true; });
      for (const end of ["pointerup", "pointercancel", "blur"]) slider.addEventListener(end, () => { this.held = false; this.place(); });
      field.addEventListener("input", () => { this.typing = field.value !== String(this.shown[0]); });
      field.addEventListener("change", () => { this.typing = false; this.sent = report(`type ${name} ${field.value.trim()}`); });
      field.addEventListener("blur", () => { if (this.typing) this.restore(); });  // what was typed and taken back is no change
      field.addEventListener("keydown", (event) => { if (event.key === "Escape") this.restore(); });
    }

    // The slider counts steps, so that both ends can be reached.
    slid() {
      const [, low, high] = this.ends, step = Number(this.slider.value);
      return step === STEPS ? high : low + step * (high - low) / STEPS;
    }

    restore() { this.typing = false; this.field.value = String(this.shown[0]); }

    show(shown) {
      this.shown = shown;
      if (!this.typing && this.field.value !== String(shown[0])) this.restore();
      this.place();
    }

    // Below a hand a slider's ends stay where they are.
    place() {
      const [value, low, high] = this.shown, { slider } = this;
      if (!this.held) {
        this.ends = this.shown;
        const step = String(Math.round((value - low) / (high - low) * STEPS));
        if (slider.value !== step) slider.value = step;
      }
      slider.setAttribute("aria-valuetext", String(value));
    }
  }

  const rows = Object.fromEntries([...document.querySelectorAll("#parameters > div")].map((box) => [box.dataset.name, new Row(box)]));
  // The server may answer an older message than the last one sent: a slider must not jump back under the hand.
  const take = (parts) => {
    for (const [part, { heard, values }] of parts) {
      if (part !== "rows") continue;
      for (const [name, shown] of Object.entries(values)) if (heard >= rows[name].sent) rows[name].show(shown);
    }
  };
  return { take, listen: (send) => { report = send; } };
})();
