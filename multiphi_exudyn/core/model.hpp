// Model: the coordinates that all levels share, the elements, and the levels that they have (eqs. 38.1, 38.2).
//
// It never changes once it is made, but for the levels that it keeps, so that many runs may share it.
#pragma once

#include <memory>
#include <vector>

#include "base.hpp"
#include "element.hpp"
#include "linear_algebra.hpp"

namespace multiphi {

class ModalLevels;

struct Model {
    std::shared_ptr<ModalLevels> levels;
    const Base& base;                 // of these levels
    Vector gaps;                      // of all links (l,) [m] at y = 0; models that differ in them share their levels
    std::vector<Element> elements;
    std::vector<int> roughest_first;  // elements by friction at rigid contacts: of redundant ones the first carries
    bool is_complete;                 // its levels keep all modes, so no truncation is to be judged
    int knots;                        // of all force laws

    // Made from the above.
    Matrix unit_directions;           // (l, m)
    bool has_friction;                // or further links: an impulse may have another direction than its contact

    Model(std::shared_ptr<ModalLevels> levels, Vector gaps, std::vector<Element> elements,
          std::vector<int> roughest_first, bool is_complete, int knots);
    Model(const Model&) = delete;

    int size() const { return static_cast<int>(elements.size()); }
    // The links that act with the elements in these states, in ascending order; they determine the modes.
    std::vector<int> active_links(const std::vector<int>& states) const;
};

}  // namespace multiphi
