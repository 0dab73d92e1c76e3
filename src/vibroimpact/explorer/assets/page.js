(() => {
  "use strict";
  const byId = (id) => document.getElementById(id);
  let doc = null;
  const model = (name) => doc && doc.get_model_by_name(name);
  let serial = 0;
  // Send a command to the server; returns its number, which the server sends back once it has run it.
  const command = (text) => {
    const box = model("command");
    if (box) box.value = `${text} ${++serial}`;
    return serial;
  };

  // ---- what goes on
  const AGAIN = 1000;  // ms between attempts to reach a server that was lost
  const be = (state, words = `${state} …`) => {
    const box = byId("state");
    if (box.dataset.is !== state) Object.assign(box, { textContent: words }).dataset.is = state;
  };
  // The server forgets a tab that left; the address holds all that it showed.
  const reconnect = async () => {
    be("lost", "lost, reconnecting …");
    write();
    for (;;) {
      await new Promise((next) => { setTimeout(next, AGAIN); });
      try { if ((await fetch(location.pathname, { cache: "no-store" })).ok) { location.reload(); return; } } catch { /* not yet */ }
    }
  };

  // ---- messages of the server
  let hush = null;
  const say = (text) => {
    const box = byId("message");
    box.textContent = text;
    box.classList.toggle("shown", Boolean(text));
    clearTimeout(hush);
    if (text) hush = setTimeout(() => box.classList.remove("shown"), 9000);
  };
  const download = (name, blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  };
  const read = () => {
    for (const letter of JSON.parse(model("mail").value || "[]")) {
      if (letter.serial <= read.last) continue;
      read.last = letter.serial;
      if (letter.message !== undefined) say(letter.message);
      if (letter.file === undefined) continue;
      const { name, type, base64 } = letter.file, bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
      download(name, new Blob([bytes], { type }));
    }
  };

  read.last = -1;

  // ---- what is shown or not
  const ticks = document.querySelectorAll("#ticks input");
  for (const box of ticks) box.addEventListener("change", () => command(box.value));

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
  const show_help = () => { help.showModal(); help.scrollTop = 0; };  // not at its only button, at the end
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

  // ---- the part of the link that only the page knows, behind #: how fast the motion plays, what plots are zoomed to
  const speed = byId("speed"), usual = speed.value;
  const fragment = () => {
    const parts = speed.value === usual ? [] : [`speed=${speed.value}`];
    for (const [name, { part }] of Object.entries(Motion.plots)) if (part) parts.push(`${name}=${part.map((end) => Number(end.toPrecision(9)))}`);
    return parts.length ? `#${parts.join("&")}` : "";
  };
  const REST = 300;  // ms: another address costs a browser as much as all plots, and it may refuse many of them
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
      else say(`${name.slice(0, 40)}=${text.slice(0, 40)} behind # in the address cannot be read and is ignored.`);
    }
    write();
  };
  for (const plot of Object.values(Motion.plots)) plot.moved = write_soon;
  speed.addEventListener("change", write);
  window.addEventListener("hashchange", follow_fragment);

  // ---- what changes together, drawn together: what came since the last frame
  const plain = (value) => (value instanceof Map ? Object.fromEntries([...value].map(([name, one]) => [name, plain(one)])) : value);
  const updates = new Set();
  const take = (update) => {
    if (!updates.size) requestAnimationFrame(unpack);
    updates.delete(update);  // the last one that came is the last one read
    updates.add(update);
  };
  const unpack = () => {
    const parts = [...updates].flatMap(({ data }) => (data.part || []).map((name, k) => [name, plain(data.content[k])]));
    const came = new Map(parts);
    updates.clear();
    for (const [name, { html }] of parts) if (name.startsWith("#")) byId(name.slice(1)).innerHTML = html;
    for (const taker of [Rows, Plane, Motion]) taker.take(parts);
    if (came.has("address")) query = `?${came.get("address").query}`;
    if (came.has("ticks")) for (const box of ticks) box.checked = came.get("ticks")[box.value];
    if (came.has("busy")) came.get("busy").busy ? be("computing") : be("ready", "ready");
    if (came.has("home") && unread) follow_fragment();
    if (came.has("address") || came.has("home")) write_soon();
    if (came.has("motion_0")) requestAnimationFrame(() => { counts.drawn += 1; counts.drawn_at = performance.now(); });
  };

  Motion.below.clicked = ({ x }) => command(`along ${x}`);
  for (const part of [Rows, Plane]) part.listen(command);

  // ---- when the page is ready
  const counts = window.explorer;
  const begin = () => {
    doc = window.Bokeh && window.Bokeh.documents[0];
    if (!doc || !model("mail")) { setTimeout(begin, 10); return; }
    doc.on_event("connection_lost", reconnect);
    model("mail").properties.value.change.connect(read);
    read();
    for (const name of ["view", "rest", "point", "plane", "hatch", "curves", "pins", "others", "line"].map((one) => `${one}_update`)) {
      const update = model(name);
      update.properties.data.change.connect(() => take(update));
      take(update);
    }
    counts.ready = performance.now();
  };
  const refused = (error) => {
    console.error(error);
    const reason = /^Error reply (.*)/.exec(error.message);  // else the websocket was not opened
    byId("message").textContent = reason ? reason[1] : "The explorer does not answer. Start it again, then reload this page.";
    byId("message").classList.add("shown");
    be("refused", "not connected");
  };
  const elements = counts.roots.map((name) => byId(`root_${name}`));
  const socket = `${location.origin.replace("http", "ws")}/ws`;
  Bokeh.embed.add_document_from_session(socket, counts.token, document.body, elements).then(begin, refused);
})();
