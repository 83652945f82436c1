"""Results as pictures: matplotlib figures and films. Needs the extra `plots`."""

from ropeode.render.extras import require

require("matplotlib", extra="plots")
