// What the theme leaves out for the keyboard and for screen readers.

const SCROLLED = ".md-typeset__scrollwrap, pre > code, .highlight-ipynb, .jp-OutputArea-output, p:has(> img)";

function complete() {
  document.querySelector(".md-search")?.setAttribute("aria-label", "Search");
  document.querySelectorAll(".md-code__nav").forEach((each, number) => {
    each.setAttribute("aria-label", `Code ${number + 1}`);
  });
  for (const each of document.querySelectorAll(SCROLLED)) {
    if (each.scrollWidth > each.clientWidth || each.matches("pre > code")) each.tabIndex = 0;
  }
}

complete();
addEventListener("load", complete);
addEventListener("resize", complete);
new MutationObserver(complete).observe(document.body, { childList: true, subtree: true });

// Paper is light.
let scheme;
matchMedia("print").addEventListener("change", ({ matches }) => {
  const { dataset } = document.body;
  if (matches) scheme = dataset.mdColorScheme;
  dataset.mdColorScheme = matches ? "default" : scheme;
});
