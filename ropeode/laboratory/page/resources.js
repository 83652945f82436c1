// @ts-check
/**
 * The texts that the page is made of: inside the document, where the page is one file, or beside it.
 *
 * @param {string} path of the file, relative to the page
 * @returns {Promise<any>} the parsed JSON
 */
export async function resource(path) {
  const inside = document.getElementById(path);
  if (inside) return JSON.parse(inside.textContent ?? "");
  const response = await fetch(path);
  if (!response.ok) throw new Error(`${path}: ${response.status} ${response.statusText}`);
  return response.json();
}
