// The menus: their entries from the server, and the entry of the view.
window.Menus = (() => {
  "use strict";
  let report = () => -1;
  const sent = {};  // serial number of the last command, by menu
  const offer = (menu, options) => {
    const made = JSON.stringify(options);
    if (menu.dataset.made === made) return;
    menu.dataset.made = made;
    menu.replaceChildren(...options.map(([value, text]) => new Option(text, value)));
    (menu.closest("label") ?? menu).hidden = !options.length;
  };
  // The server may answer an older message than the last one sent: a menu must not jump back while in use.
  const take = (parts) => {
    for (const [part, { heard, menus }] of parts) {
      if (part !== "menus") continue;
      for (const [name, [options, value]] of Object.entries(menus)) {
        const menu = document.getElementById(`menu_${name}`);
        offer(menu, options);
        if (heard >= (sent[name] ?? -1)) menu.value = value;
      }
    }
  };
  const listen = (send) => {
    report = send;
    for (const menu of document.querySelectorAll("select[id^=menu_]")) {
      const name = menu.id.slice("menu_".length);
      menu.addEventListener("change", () => { sent[name] = report(`choose ${name} ${menu.value}`); });
    }
  };
  return { take, listen };
})();
