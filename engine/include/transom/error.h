/// @file The engine's one exception: input that cannot be right, with what was found and what is allowed.
#pragma once

#include <stdexcept>
#include <string>

namespace transom {

/// Bad input. The caller knows the file and the field; the text says what was found, what is allowed and the remedy.
class InputError : public std::runtime_error {
 public:
  explicit InputError(const std::string& text) : std::runtime_error(text) {}
};

}  // namespace transom
