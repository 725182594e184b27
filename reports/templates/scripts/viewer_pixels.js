"use strict";
// What a viewer knows of its pixels, and its pictures in false colour on the printed scales.

const SHARED = JSON.parse(document.getElementById("shared-scales").textContent);

async function readPixels(text) {
  const record = JSON.parse(text);
  const count = record.width * record.height;
  const [noise, surface] = await Promise.all([unpack(record.noise, count), unpack(record.surface, count)]);
  const pixels = { width: record.width, height: record.height, surface, surfaceNames: record.surfaces };
  for (const name of ["ours", "reference"]) {
    const [codes, ratios] = await Promise.all([
      unpack(record[name].luminance, count),
      unpack(record[name].lux, count),
    ]);
    const luminance = logValues(codes, SHARED.codes);
    const illuminance = logValues(ratios, SHARED.codes).map((ratio, index) => ratio * luminance[index]);
    pixels[name] = { luminance, illuminance };
  }
  pixels.noise = Float64Array.from(noise, (code) => (code === 255 ? NaN : code * SHARED.noiseStep));
  // The same difference as in the tables: relative to the reference and its floor, inside the room only.
  pixels.difference = Float64Array.from(pixels.noise, (known, index) => {
    const truth = pixels.reference.luminance[index];
    return Number.isNaN(known) ? NaN : (100 * (pixels.ours.luminance[index] - truth)) / (truth + record.floor);
  });
  pixels.scales = {
    luminance: record.luminanceScale,
    illuminance: SHARED.illuminance,
    difference: SHARED.difference,
    noise: SHARED.noise,
  };
  return pixels;
}

// Place of a value on a scale, 0 to 1; values outside take the colours of the ends.
function placeOnScale(value, scale) {
  if (Number.isNaN(value)) return NaN;
  if (scale.kind !== "log") return Math.min(1, Math.max(0, (value - scale.low) / (scale.high - scale.low)));
  if (value <= 0) return 0;
  const place = Math.log(value / scale.low) / Math.log(scale.high / scale.low);
  return Math.min(1, Math.max(0, place));
}

function falseColour(values, width, height, scale) {
  const colours = Uint8Array.from(atob(scale.colours), (letter) => letter.charCodeAt(0));
  const last = colours.length / 3 - 1;
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  for (let index = 0; index < values.length; index++) {
    const place = placeOnScale(values[index], scale);
    const start = 3 * Math.round(place * last);
    for (let channel = 0; channel < 3; channel++) {
      image.data[4 * index + channel] = Number.isNaN(place) ? SHARED.noValueGrey : colours[start + channel];
    }
    image.data[4 * index + 3] = 255;
  }
  context.putImageData(image, 0, 0);
  return canvas;
}
