// Folded steps: a link opens what it leads to; printing opens the verdict's reasons and the warnings.
const openTo = (hash) => {
  const target = hash.length > 1 && document.getElementById(decodeURIComponent(hash.slice(1)));
  if (!target) return;
  for (const fold of [target.querySelector(":scope > details"), target.closest("details")]) if (fold) fold.open = true;
  target.scrollIntoView();
};
addEventListener("hashchange", () => openTo(location.hash));
addEventListener("click", (event) => {
  const link = event.target.closest('a[href^="#"]');
  if (link) openTo(link.getAttribute("href"));
});
openTo(location.hash);
let folded = [];
addEventListener("beforeprint", () => {
  folded = [...document.querySelectorAll(":is(#why, #warnings) details:not([open])")];
  for (const fold of folded) fold.open = true;
});
addEventListener("afterprint", () => folded.forEach((fold) => { fold.open = false; }));
