"use strict";
// Arrays of the viewers: base64 of deflated bytes, all high bytes first and then all low bytes; see viewer.py.

async function unpack(text, count) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const codes = new Uint16Array(count);
  for (let index = 0; index < count; index++) codes[index] = (bytes[index] << 8) | bytes[count + index];
  return codes;
}

// 16-bit logarithms to values: code 0 is no value (NaN), code 1 is zero.
function logValues(codes, scheme) {
  const steps = scheme.last - scheme.first;
  const values = new Float64Array(codes.length);
  for (let index = 0; index < codes.length; index++) {
    const code = codes[index];
    if (code === 0) values[index] = NaN;
    else if (code < scheme.first) values[index] = 0;
    else values[index] = 2 ** (scheme.lowestOctave + (scheme.octaves * (code - scheme.first)) / steps);
  }
  return values;
}

const THIN_SPACE = "\u202f";

// A number with three significant digits, thin spaces between thousands, a true minus sign.
function threeDigits(value) {
  if (!Number.isFinite(value)) return "n/a";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const digits = Math.max(0, 2 - Math.floor(Math.log10(size)));
  const text = size.toFixed(Math.min(digits, 4)).replace(/\B(?=(\d{3})+(?!\d))(?<!\.\d*)/g, THIN_SPACE);
  return (value < 0 ? "\u2212" : "") + text;
}

function signedPercent(value) {
  if (!Number.isFinite(value)) return "n/a";
  const text = Math.abs(value).toFixed(1) + THIN_SPACE + "%";
  if (text.startsWith("0.0")) return text;
  return (value > 0 ? "+" : "\u2212") + text;
}

function withUnit(value, unit) {
  return Number.isFinite(value) ? threeDigits(value) + THIN_SPACE + unit : "n/a";
}
