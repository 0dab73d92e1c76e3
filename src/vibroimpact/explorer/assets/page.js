(() => {
  "use strict";
  const byId = (id) => document.getElementById(id);
  let doc = null;
  const model = (name) => doc && doc.get_model_by_name(name);
  let serial = 0;
  const command = (text) => { const box = model("command"); if (box) box.value = `${text} ${++serial}`; };

  // ---- what the server has to say
  let hush = null;
  const say = (text) => {
    const box = byId("message");
    box.textContent = text;
    box.classList.toggle("shown", Boolean(text));
    clearTimeout(hush);
    if (text) hush = setTimeout(() => box.classList.remove("shown"), 9000);
  };
  const download = (file) => {
    const bytes = Uint8Array.from(atob(file.base64), (c) => c.charCodeAt(0));
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([bytes], { type: file.type }));
    link.download = file.name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  };
  const read = () => {
    for (const letter of JSON.parse(model("mail").value || "[]")) {
      if (letter.serial <= read.last) continue;
      read.last = letter.serial;
      if (letter.address !== undefined) history.replaceState(null, "", `?${letter.address}`);
      if (letter.message !== undefined) say(letter.message);
      if (letter.file !== undefined) download(letter.file);
    }
  };

  read.last = -1;

  // ---- the mass against its stop
  const canvas = byId("play-canvas"), pen = canvas.getContext("2d");
  let playing = false, clock = 0, before = 0;
  const place = (time, y, t) => {
    let low = 0, high = time.length - 1;
    while (high - low > 1) { const mid = (low + high) >> 1; if (time[mid] <= t) low = mid; else high = mid; }
    const span = time[high] - time[low];
    return span > 0 ? y[low] + (y[high] - y[low]) * (t - time[low]) / span : y[low];
  };
  const draw = () => {
    const source = model("history_0"), facts = model("facts");
    if (!source || !facts || !source.data.time || !source.data.time.length) return;
    const time = source.data.time, y = source.data.displacement, { gap, period, force } = facts.data;
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio)) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio); }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const first = time[0], last = time[time.length - 1];
    const now = last > first ? first + (clock * period[0]) % (last - first) : first;
    const at = place(time, y, now), stop = gap[0];
    const low = facts.data.low[0], side = 13, left = 96, right = width - 130;
    const scale = (right - left) / Math.max(stop - low, 1e-300);
    const x = left + (at - low) * scale, middle = height / 2;
    pen.lineWidth = 1.3; pen.strokeStyle = "#5b6470"; pen.fillStyle = "#5b6470";
    pen.beginPath(); pen.moveTo(12, 6); pen.lineTo(12, height - 6); pen.stroke();
    pen.beginPath(); pen.moveTo(12, middle);
    const from = 20, to = x - 2 * side;
    for (let i = 0; i <= 16; i++) pen.lineTo(from + (to - from) * i / 16, middle + (i % 2 ? 7 : -7) * (i > 0 && i < 16));
    pen.lineTo(x - 2 * side, middle); pen.stroke();
    pen.fillStyle = "#0072b2"; pen.fillRect(x - 2 * side, middle - side, 2 * side, 2 * side);
    pen.fillStyle = "#444"; pen.fillRect(right, 4, 3, height - 8);
    pen.strokeStyle = "#999"; pen.lineWidth = 1;
    for (let i = 4; i < height - 4; i += 6) { pen.beginPath(); pen.moveTo(right + 3, i + 5); pen.lineTo(right + 9, i); pen.stroke(); }
    const push = force[0] * Math.sin(2 * Math.PI * now / period[0]) * 26;
    pen.strokeStyle = "#d55e00"; pen.fillStyle = "#d55e00"; pen.lineWidth = 2;
    pen.beginPath(); pen.moveTo(x - side, middle - side - 4); pen.lineTo(x - side + push, middle - side - 4); pen.stroke();
    if (Math.abs(push) > 3) { const s = Math.sign(push), tip = x - side + push; pen.beginPath(); pen.moveTo(tip + 4 * s, middle - side - 4); pen.lineTo(tip, middle - side - 8); pen.lineTo(tip, middle - side); pen.fill(); }
    pen.fillStyle = "#222"; pen.font = "12px Arial, sans-serif";
    pen.fillText(`t = ${now.toPrecision(4)} s`, right + 18, middle - 3);
    pen.fillText(`y = ${at.toPrecision(3)} m`, right + 18, middle + 13);
    const span = model("now");
    if (span && playing) span.location = now;
  };
  const tick = (stamp) => {
    if (!playing) return;
    if (stamp - before > 30) { clock += Math.min(stamp - before, 200) / 1000 * Number(byId("speed").value); before = stamp; draw(); }
    requestAnimationFrame(tick);
  };
  const play = () => {
    playing = !playing;
    byId("play").textContent = playing ? "❚❚ Pause" : "▶ Play";
    const span = model("now");
    if (span) span.visible = playing;
    before = performance.now();
    if (playing) requestAnimationFrame(tick);
  };
  byId("play").addEventListener("click", play);
  window.addEventListener("resize", draw);

  // ---- link, help, keys
  byId("copy").addEventListener("click", async () => {
    try { await navigator.clipboard.writeText(location.href); say("The link to this view is copied."); }
    catch { say(`Copy the address from here: ${location.href}`); }
  });
  const help = byId("help");
  byId("help-button").addEventListener("click", () => help.showModal());
  help.addEventListener("click", (event) => { if (event.target === help) help.close(); });
  document.addEventListener("keydown", (event) => {
    const deep = event.composedPath()[0];
    const types = deep instanceof HTMLElement && /^(INPUT|SELECT|TEXTAREA)$/.test(deep.tagName);
    if ((event.ctrlKey || event.metaKey) && !event.altKey && !types) {
      const key = event.key.toLowerCase();
      if (key === "z") { command(event.shiftKey ? "redo" : "undo"); event.preventDefault(); }
      if (key === "y") { command("redo"); event.preventDefault(); }
      return;
    }
    if (types || event.altKey || help.open) return;
    const keys = { p: "pin", u: "unpin", h: "home", b: "boundaries", g: "log", d: "line", m: "motion", "+": "in", "=": "in", "-": "out",
      ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down" };
    if (event.key === " " && !(deep instanceof HTMLButtonElement)) { play(); event.preventDefault(); }
    else if (event.key === "?") help.showModal();
    else if (event.key.toLowerCase() === "l") byId("copy").click();
    else if (keys[event.key] && !(event.key.startsWith("Arrow") && deep instanceof HTMLElement && deep.getAttribute("role") === "slider")) {
      command(keys[event.key]);
      event.preventDefault();
    }
  });

  // ---- many properties at once, without telling the server what it told us
  const unpack = (parcel) => {
    const names = parcel.data.model || [], sets = parcel.data.set || [];
    for (let i = 0; i < names.length; i++) {
      const properties = sets[i] instanceof Map ? Object.fromEntries(sets[i]) : { ...sets[i] };
      if (properties.data instanceof Map) properties.data = Object.fromEntries(properties.data);
      if (names[i].startsWith("#")) byId(names[i].slice(1)).innerHTML = properties.html;
      else model(names[i]).setv(properties, { sync: false });
    }
    if (!names.includes("history_0")) return;
    if (!playing) draw();
    requestAnimationFrame(() => requestAnimationFrame(() => { told.drawn += 1; told.drawn_at = performance.now(); }));
  };

  // ---- when the page stands
  const told = window.explorer = { ready: 0, drawn: 0, drawn_at: 0, planes: [] };
  // Bokeh asks the style sheet for each colour and width at each stroke, a third of all time of drawing; there are none.
  // It also asks for the size of the page's letters at each label of an axis: once is enough.
  try {
    Bokeh.require("core/visuals/visual").VisualProperties.prototype._get_css_value = () => "";
    const size = parseFloat(getComputedStyle(document.body).fontSize) || 13;
    Object.defineProperty(Bokeh.require("models/plots/plot").PlotView.prototype, "base_font_size", { get: () => size, configurable: true });
  } catch { /* it draws all the same, slower */ }
  const begin = () => {
    doc = window.Bokeh && window.Bokeh.documents[0];
    if (!doc || !model("mail")) { setTimeout(begin, 10); return; }
    model("mail").properties.value.change.connect(read);
    read();
    for (const name of ["point_parcel", "pins_parcel", "others_parcel"]) {
      const parcel = model(name);
      parcel.properties.data.change.connect(() => unpack(parcel));
      unpack(parcel);
    }
    const side = () => { const seen = model("plane_source").data.side; if (seen && seen.length) told.planes.push([seen[0], performance.now()]); };
    model("plane_source").properties.data.change.connect(side);
    side();
    told.ready = performance.now();
    draw();
  };
  begin();
})();
