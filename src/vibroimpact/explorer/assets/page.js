(() => {
  "use strict";
  const byId = (id) => document.getElementById(id);
  const socket = new WebSocket(`${location.origin.replace("http", "ws")}/ws${location.search}`);
  socket.binaryType = "arraybuffer";
  let serial = 0;
  // Send a command to the server; returns its number, which the server sends back once it has run it.
  const command = (text) => {
    if (socket.readyState === WebSocket.OPEN) socket.send(`${text} ${++serial}`);
    return serial;
  };

  // ---- state of the connection
  const AGAIN = 1000;  // ms between attempts to reach a server that was lost
  const FULL = 1013;  // close code of a server that has no room
  const be = (state, words = `${state} …`) => {
    const box = byId("state");
    if (box.dataset.is !== state) Object.assign(box, { textContent: words }).dataset.is = state;
  };
  // The server forgets a closed tab; the address holds its whole view.
  const reconnect = async () => {
    be("lost", "lost, reconnecting …");
    write();
    for (;;) {
      await new Promise((next) => { setTimeout(next, AGAIN); });
      try { if ((await fetch(location.pathname, { cache: "no-store" })).ok) { location.reload(); return; } } catch { /* not yet */ }
    }
  };

  // ---- messages from the server
  let hush = null;
  const say = (text, stays = socket.readyState !== WebSocket.OPEN) => {
    const box = byId("message");
    box.textContent = text;
    box.classList.toggle("shown", Boolean(text));
    clearTimeout(hush);
    if (text && !stays) hush = setTimeout(() => box.classList.remove("shown"), 9000);
  };
  const download = (name, blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  };
  // ---- options
  const ticks = document.querySelectorAll("#ticks input");
  for (const box of ticks) box.addEventListener("change", () => command(box.value));
  for (const button of document.querySelectorAll("#buttons button")) button.addEventListener("click", () => command(button.value));

  byId("late").addEventListener("click", ({ target }) => { if (target.value) command(target.value); });

  // ---- export, link, help, keys
  const menu = byId("export");
  menu.addEventListener("click", ({ target }) => {
    if (!(target instanceof HTMLButtonElement)) return;
    menu.open = false;
    if (target.value === "png") Picture.draw().toBlob((blob) => download("view.png", blob));
    else command(`export ${target.value}`);
  });
  menu.addEventListener("keydown", ({ key }) => { if (key === "Escape") { menu.open = false; menu.firstElementChild.focus(); } });
  document.addEventListener("click", ({ target }) => { if (!menu.contains(target)) menu.open = false; });
  byId("copy").addEventListener("click", async () => {
    write();
    try { await navigator.clipboard.writeText(location.href); say("Link copied."); }
    catch { say(`Copy this address: ${location.href}`); }
  });
  const help = byId("help");
  const show_help = () => { help.showModal(); help.scrollTop = 0; };  // not scrolled to its only button, at the end
  byId("help-button").addEventListener("click", show_help);
  help.addEventListener("click", (event) => { if (event.target === help) help.close(); });
  document.addEventListener("keydown", (event) => {
    const deep = event.composedPath()[0];
    const slides = deep instanceof HTMLInputElement && /^(range|checkbox)$/.test(deep.type);
    const types = !slides && deep instanceof HTMLElement && /^(INPUT|SELECT|TEXTAREA)$/.test(deep.tagName);
    if ((event.ctrlKey || event.metaKey) && !event.altKey && !types) {
      const key = event.key.toLowerCase();
      if (key === "z") { command(event.shiftKey ? "redo" : "undo"); event.preventDefault(); }
      if (key === "y") { command("redo"); event.preventDefault(); }
      return;
    }
    if (types || event.altKey || help.open) return;
    const keys = { p: "pin", u: "unpin", h: "home", b: "boundaries", g: "log", d: "line", m: "motion", "+": "in", "=": "in", "-": "out",
      ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down" };
    if (event.key === " " && !deep.matches("button, summary, input")) { Motion.play(); event.preventDefault(); }
    else if (event.key === "?") show_help();
    else if (event.key.toLowerCase() === "l") byId("copy").click();
    else if (keys[event.key] && !(event.key.startsWith("Arrow") && deep.type === "range")) {
      command(keys[event.key]);
      event.preventDefault();
    }
  });

  // ---- the part of the link after #, known only to the page: speed of the animation, zoom of the plots
  const speed = byId("speed"), usual = speed.value;
  const fragment = () => {
    const parts = speed.value === usual ? [] : [`speed=${speed.value}`];
    for (const [name, { part }] of Object.entries(Motion.plots)) if (part) parts.push(`${name}=${part.map((end) => Number(end.toPrecision(9)))}`);
    return parts.length ? `#${parts.join("&")}` : "";
  };
  const REST = 300;  // ms: changing the address takes as long as drawing all plots, and browsers refuse frequent changes
  let writing = null, unread = true, query = location.search;
  const write = () => {
    clearTimeout(writing);
    history.replaceState(null, "", location.pathname + query + (unread ? location.hash : fragment()));
  };
  const write_soon = () => { clearTimeout(writing); writing = setTimeout(write, REST); };
  // Once the plots have their data.
  const follow_fragment = () => {
    unread = false;
    for (const [name, text] of new URLSearchParams(location.hash.slice(1))) {
      const ends = text.split(",").map(Number), plot = Object.hasOwn(Motion.plots, name) ? Motion.plots[name] : null;
      if (name === "speed" && [...speed.options].some((one) => one.value === text)) speed.value = text;
      else if (plot && ends.length === 4 && ends.every(Number.isFinite) && ends[0] < ends[1] && ends[2] < ends[3]) plot.show(ends);
      else say(`${name.slice(0, 40)}=${text.slice(0, 40)} after # in the address is invalid and was ignored.`);
    }
    write();
  };
  for (const plot of Object.values(Motion.plots)) plot.moved = write_soon;
  speed.addEventListener("change", write);
  window.addEventListener("hashchange", follow_fragment);

  // ---- all changes since the last frame are drawn together
  const TYPES = { float64: Float64Array, float32: Float32Array, uint16: Uint16Array, uint8: Uint8Array };
  const unpack = (message) => {
    const length = new DataView(message).getUint32(0, true), begin = 4 + length;
    const array = (key, one) => {
      if (!one?.array) return one;
      const [type, place, size] = one.array;
      return new TYPES[type](message, begin + place, size);
    };
    return JSON.parse(new TextDecoder().decode(new Uint8Array(message, 4, length)), array);
  };
  let waiting = [];
  const take = (parts) => {
    if (!waiting.length) requestAnimationFrame(draw);
    waiting.push(...parts);
  };
  const draw = () => {
    const parts = waiting, came = new Map(parts);
    waiting = [];
    for (const [name, { html }] of parts) if (name.startsWith("#")) byId(name.slice(1)).innerHTML = html;
    for (const taker of [Rows, Menus, Plane, Motion]) taker.take(parts);
    for (const [name, content] of parts) {
      if (name === "message") say(content.text);
      if (name === "file") download(content.name, new Blob([content.content], { type: content.type }));
    }
    if (came.has("address")) query = `?${came.get("address").query}`;
    if (came.has("ticks")) for (const box of ticks) {
      box.closest("label").hidden = !(box.value in came.get("ticks"));
      box.checked = came.get("ticks")[box.value];
    }
    if (came.has("busy")) {
      const { busy, compiling } = came.get("busy");
      if (!busy) be("ready", "ready");
      else be(compiling ? "compiling" : "computing");
      byId("state").title = compiling;
    }
    if (came.has("home") && unread) follow_fragment();
    if (came.has("address") || came.has("home")) write_soon();
    if (came.has("motion_0")) requestAnimationFrame(() => { counts.drawn += 1; counts.drawn_at = performance.now(); });
  };

  Motion.below.clicked = ({ x }) => command(`along ${x}`);
  for (const part of [Rows, Menus, Plane]) part.listen(command);

  // ---- when the page is ready
  const counts = window.explorer;
  socket.addEventListener("message", ({ data }) => {
    if (!counts.ready) counts.ready = performance.now();
    take(unpack(data));
  });
  socket.addEventListener("close", ({ code }) => {
    if (counts.ready && code !== FULL) { reconnect(); return; }
    if (!counts.ready) say("The explorer does not answer. Start it again, then reload this page.", true);
    be("refused", "not connected");
  });
})();
