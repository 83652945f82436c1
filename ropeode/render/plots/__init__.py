"""Results as pictures: matplotlib figures and films. Needs the extra `plots`."""

from ropeode.validation import require

require("matplotlib", "plots", "pictures")
