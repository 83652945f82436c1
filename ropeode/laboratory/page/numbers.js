// Numbers as a reader writes them, with superscripts.

// No line breaks within a number.
const TIMES = "\u00a0×\u00a0";
const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/**
 * A whole number as a superscript.
 * @param {number} whole
 */
export function raised(whole) {
  const digits = [...String(Math.abs(whole))].map((each) => RAISED[Number(each)]).join("");
  return whole < 0 ? `⁻${digits}` : digits;
}

/**
 * A number with so many digits; very large and very small ones with a power of ten.
 * @param {number} value
 */
export function written(value, digits = 3) {
  if (value === 0) return "0";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : value < 0 ? "−∞" : "–";
  const [mantissa, power] = value.toExponential(digits - 1).split("e");
  const exponent = Number(power);
  if (exponent < -3 || exponent > 4) return minus(`${mantissa}${TIMES}10${raised(exponent)}`);
  return minus(value.toFixed(Math.max(0, digits - 1 - exponent)));
}

/**
 * A number with no digit more than it needs, and no more than so many.
 * @param {number} value
 */
export function shortly(value, digits = 12) {
  if (value === 0) return "0";
  const [mantissa, power] = value.toExponential(digits - 1).split("e");
  const exponent = Number(power);
  if (exponent >= -3 && exponent <= 4) return minus(String(Number(value.toPrecision(digits))));
  const factor = String(Number(mantissa));
  const ten = `10${raised(exponent)}`;
  if (factor === "1") return ten;
  return minus(factor === "-1" ? `-${ten}` : `${factor}${TIMES}${ten}`);
}

/**
 * A power of ten, always as one.
 * @param {number} exponent
 */
export function powerOfTen(exponent) {
  return exponent === 0 ? "1" : exponent === 1 ? "10" : `10${raised(exponent)}`;
}

/** @param {string} text */
function minus(text) {
  return text.replace("-", "−");
}
