// Level builder: a level of given states of all elements under the loads of a run (eqs. 38.2 to 38.6).
#pragma once

#include <limits>
#include <vector>

#include "excitation.hpp"
#include "level.hpp"
#include "model.hpp"
#include "sliding.hpp"

namespace multiphi {

// What is known of the level of a key, in base coordinates and in xi. moving: its modes, of the links that act in it.
// duration: of the longest motion [s].
LevelData build_level(const Model& model, const Excitation& excitation, const MovingLevel& moving, const Key& key,
                      double duration);

}  // namespace multiphi
