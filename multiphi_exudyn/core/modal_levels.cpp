#include "modal_levels.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace multiphi {

std::shared_ptr<const MovingLevel> ModalLevels::level(const std::vector<int>& links) {
    {
        const std::lock_guard lock(mutex_);
        const auto found = levels_.find(links);
        if (found != levels_.end()) {
            uses_.splice(uses_.begin(), uses_, found->second.use);
            return found->second.level;
        }
    }
    std::shared_ptr<const MovingLevel> made = make(links);  // without the lock: it takes its time
    const std::lock_guard lock(mutex_);
    const auto [place, is_new] = levels_.try_emplace(links);
    if (!is_new) return place->second.level;
    uses_.push_front(links);
    place->second = {std::move(made), uses_.begin(), nullptr};
    ++built_;
    auto result = place->second.level;
    forget();
    return result;
}

std::shared_ptr<const MovingLevel> ModalLevels::make(const std::vector<int>& links) {
    std::vector<int> host, acting;
    for (const int link : links) (base_->is_residual(link) ? acting : host).push_back(link);
    if (acting.empty()) return std::make_shared<const MovingLevel>(*base_, links, kept_);
    return std::make_shared<const MovingLevel>(*boundary(host), acting);
}

std::shared_ptr<const ResidualBoundary> ModalLevels::boundary(const std::vector<int>& links) {
    const std::shared_ptr<const MovingLevel> host = level(links);
    {
        const std::lock_guard lock(mutex_);
        const auto found = levels_.find(links);
        if (found != levels_.end() && found->second.boundary) return found->second.boundary;
    }
    auto made = std::make_shared<const ResidualBoundary>(host);
    const std::lock_guard lock(mutex_);
    const auto found = levels_.find(links);
    if (found != levels_.end() && !found->second.boundary) found->second.boundary = made;
    return made;
}

void ModalLevels::forget() {
    while (static_cast<int>(levels_.size()) > most_) {
        levels_.erase(uses_.back());
        uses_.pop_back();
    }
}

int ModalLevels::built() const {
    const std::lock_guard lock(mutex_);
    return built_;
}

int ModalLevels::count() const {
    const std::lock_guard lock(mutex_);
    return static_cast<int>(levels_.size());
}

void ModalLevels::set_most(int most) {
    const std::lock_guard lock(mutex_);
    most_ = most;
    forget();
}

double ModalLevels::highest_frequency() const {
    const std::lock_guard lock(mutex_);
    double square = 0.0;
    for (const auto& [links, entry] : levels_) {
        const Vector& squares = entry.level->modal.squares;
        if (squares.size() > 0) square = std::max(square, squares.maxCoeff());
    }
    return std::sqrt(square) / (2.0 * std::numbers::pi);
}

}  // namespace multiphi
