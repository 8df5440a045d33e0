#include "proto/digest.h"

#include <fstream>
#include <string_view>
#include <vector>

#include <openssl/evp.h>

#include "core/base/error.h"
#include "proto/json.h"

namespace lightkiln {

struct Sha256::Impl {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  ~Impl() { EVP_MD_CTX_free(context); }
};

namespace {
void expect_success(int result) {
  if (result != 1) throw Error(ErrorCode::internal, "SHA-256 failed in libcrypto.");
}
}  // namespace

Sha256::Sha256() : impl_(std::make_unique<Impl>()) {
  expect_success(EVP_DigestInit_ex(impl_->context, EVP_sha256(), nullptr));
}
Sha256::~Sha256() = default;
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;

void Sha256::append(const void* data, size_t size) {
  expect_success(EVP_DigestUpdate(impl_->context, data, size));
}

std::string Sha256::digest() {
  static constexpr char kHex[] = "0123456789abcdef";
  unsigned char bytes[EVP_MAX_MD_SIZE];
  unsigned size = 0;
  expect_success(EVP_DigestFinal_ex(impl_->context, bytes, &size));
  std::string text = "sha256:";
  for (unsigned i = 0; i < size; ++i) {
    text += kHex[bytes[i] >> 4];
    text += kHex[bytes[i] & 15];
  }
  return text;
}

std::string sha256_digest(const void* data, size_t size) {
  Sha256 hash;
  hash.append(data, size);
  return hash.digest();
}

FileDigest sha256_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file || std::filesystem::is_directory(path))
    throw Error(ErrorCode::not_found, "The file " + path.string() + " cannot be read.");
  Sha256 hash;
  FileDigest result;
  std::vector<char> buffer(1 << 20);
  while (file) {
    file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    hash.append(buffer.data(), static_cast<size_t>(file.gcount()));
    result.bytes += static_cast<uint64_t>(file.gcount());
  }
  if (file.bad())
    throw Error(ErrorCode::not_found, "The file " + path.string() + " cannot be read to its end.");
  result.digest = hash.digest();
  return result;
}

bool is_digest(std::string_view text) {
  if (text.size() != 71 || !text.starts_with("sha256:")) return false;
  return text.find_first_not_of("0123456789abcdef", 7) == std::string_view::npos;
}

}  // namespace lightkiln
