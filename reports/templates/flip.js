// Pointing at our picture shows the reference's, which is the next one, in its place.
for (const image of document.querySelectorAll("img.flips")) {
  const ours = image.src;
  const reference = image.closest(".pictures").querySelectorAll("img")[1].src;
  image.addEventListener("pointerenter", () => { image.src = reference; });
  image.addEventListener("pointerleave", () => { image.src = ours; });
}
