// Rows of equal length, one after the other, in memory that is kept where fewer or shorter ones are needed next.
#pragma once

#include <cassert>
#include <cstddef>
#include <vector>

namespace multiphi {

class Rows {
  public:
    // Sets the number of rows and their length. What they hold is undefined afterwards.
    void resize(int count, int length) {
        count_ = count;
        length_ = length;
        numbers_.resize(static_cast<std::size_t>(count) * static_cast<std::size_t>(length));
    }

    // Appends a row of zeros and returns its number; the others stay.
    int add() {
        numbers_.resize(numbers_.size() + static_cast<std::size_t>(length_), 0.0);
        return count_++;
    }

    double* operator[](int row) {
        assert(row >= 0 && row < count_);
        return numbers_.data() + static_cast<std::ptrdiff_t>(row) * length_;
    }
    const double* operator[](int row) const {
        assert(row >= 0 && row < count_);
        return numbers_.data() + static_cast<std::ptrdiff_t>(row) * length_;
    }

    int count() const { return count_; }
    int length() const { return length_; }

  private:
    std::vector<double> numbers_;
    int count_ = 0;
    int length_ = 0;
};

}  // namespace multiphi
