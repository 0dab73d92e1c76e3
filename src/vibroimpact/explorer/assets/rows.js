// The seven numbers: for each a field to type into and a slider.
window.Rows = (() => {
  "use strict";
  const STEPS = 500;
  let report = () => -1;

  class Row {
    constructor(box) {
      [this.field, this.slider] = box.querySelectorAll("input");
      Object.assign(this, { told: "", typing: false, sent: -1 });
      const { name } = box.dataset, { field, slider } = this;
      slider.addEventListener("input", () => { this.sent = report(`slide ${name} ${slider.value}`); });
      field.addEventListener("input", () => { this.typing = true; });
      field.addEventListener("change", () => { this.typing = false; this.sent = report(`type ${name} ${field.value.trim()}`); });
      field.addEventListener("keydown", (event) => { if (event.key === "Escape") { this.typing = false; field.value = this.told; } });
    }

    show(value, low, high) {
      const { field, slider } = this;
      this.told = String(value);
      if (!this.typing && field.value !== this.told) field.value = this.told;
      const ends = { min: low, max: high, step: (high - low) / STEPS };
      for (const [name, end] of Object.entries(ends)) if (slider[name] !== String(end)) slider[name] = end;
      if (slider.value !== this.told) slider.value = value;
    }
  }

  const rows = Object.fromEntries([...document.querySelectorAll("#parameters > div")].map((box) => [box.dataset.name, new Row(box)]));
  // What the server tells is older than what was slid since: a slider must not jump back below the hand.
  const take = (parts) => {
    for (const [part, { heard, values }] of parts) {
      if (part !== "rows") continue;
      for (const [name, told] of Object.entries(values)) if (heard >= rows[name].sent) rows[name].show(...told);
    }
  };
  return { take, listen: (tell) => { report = tell; } };
})();
