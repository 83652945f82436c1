// The theme gives the signs that unfold a menu no name for screen readers.
for (const sign of document.querySelectorAll(".bd-sidebar-primary summary")) {
  sign.setAttribute("aria-label", "The pages below");
}
