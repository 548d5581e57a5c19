#include "model.hpp"

#include <algorithm>
#include <utility>

#include "modal_levels.hpp"

namespace multiphi {

Model::Model(std::shared_ptr<ModalLevels> given, Vector initial, std::vector<Element> all, std::vector<int> roughest,
             bool complete, int knot_count)
    : levels(std::move(given)), base(*levels->base()), gaps(std::move(initial)), elements(std::move(all)), roughest_first(std::move(roughest)),
      is_complete(complete), knots(knot_count), unit_directions(base.directions) {
    for (int link = 0; link < base.links(); ++link) {
        if (base.sizes[link] > 0.0) unit_directions.row(link) /= base.sizes[link];
    }
    has_friction = std::any_of(elements.begin(), elements.end(), [](const Element& element) {
        return element.links.size() > 1 || element.has_stick();
    });
}

std::vector<int> Model::active_links(const std::vector<int>& states) const {
    std::vector<int> result;
    for (int i = 0; i < size(); ++i) {
        const std::vector<int>& links = elements[i].states[states[i]].links;
        result.insert(result.end(), links.begin(), links.end());
    }
    std::sort(result.begin(), result.end());
    return result;
}

}  // namespace multiphi
