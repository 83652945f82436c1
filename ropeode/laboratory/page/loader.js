// @ts-check
// Starts the page where it is one file: its modules are texts of the document, each after those
// that it imports, and are given addresses here.
(() => {
  /** @type {{[path: string]: string}} */
  const addresses = {};
  const texts = document.getElementById("modules")?.textContent ?? "[]";
  for (const [path, text] of JSON.parse(texts)) {
    const linked = text.replace(/"lab:([^"]+)"/g, (/** @type {string} */ _, /** @type {string} */ other) =>
      `"${addresses[other]}"`);
    const module = new Blob([linked, `\n//# sourceURL=lab/${path}\n`], { type: "text/javascript" });
    addresses[path] = URL.createObjectURL(module);
  }
  import(addresses["main.js"]);
})();
