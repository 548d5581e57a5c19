#include "model.hpp"

#include <algorithm>
#include <cmath>

namespace multiphi {

void Model::prepare() {
    const int m = base.modes(), links = base.links();
    omega.resize(m);
    periods.resize(m);
    for (int i = 0; i < m; ++i) {
        omega[i] = std::sqrt(base.squares[i]);
        periods[i] = omega[i] > 0.0 ? 1.0 / omega[i] : 0.0;
    }
    unit_directions = base.directions;
    for (int link = 0; link < links; ++link) {
        const double length = unit_directions.row(link).norm();
        if (length > 0.0) unit_directions.row(link) /= length;
    }
    has_friction = std::any_of(elements.begin(), elements.end(), [](const Element& element) {
        return element.links.size() > 1 || element.has_stick();
    });
}

}  // namespace multiphi
