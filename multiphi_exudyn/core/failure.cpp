#include "failure.hpp"

#include <cstdio>

namespace multiphi {

std::string text_of(double number) {
    char text[32];
    std::snprintf(text, sizeof text, "%g", number);
    return text;
}

}  // namespace multiphi
