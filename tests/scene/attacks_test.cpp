// Hostile files, each built to break a reader that trusts what it is told.

#include <cstring>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/scene/gltf.h"
#include "core/scene/gltf_uri.h"
#include "tests/support/gltf_builder.h"

using namespace lightkiln;
using namespace lightkiln::test;

namespace {

std::vector<std::byte> bytes_of(const std::string& text) {
  std::vector<std::byte> bytes(text.size());
  std::memcpy(bytes.data(), text.data(), text.size());
  return bytes;
}

// The error that loading gives; fails when it loads.
Error refused(const std::vector<std::byte>& file, const GltfLoadOptions& options = {},
              const std::map<std::string, std::span<const std::byte>>& resources = {}) {
  try {
    load_gltf({file, resources}, options);
  } catch (const Error& error) {
    return error;
  }
  ADD_FAILURE() << "the file loads";
  return {ErrorCode::internal, "loaded"};
}

Error refused(const std::string& json, size_t bin_bytes = 64) {
  return refused(make_glb_container(json, std::vector<std::byte>(bin_bytes)));
}

// A triangle of zeros, with one part of its JSON replaced. The control is that it loads unchanged.
const std::string kTriangle =
    R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
    R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)"
    R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],)"
    R"("bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36}]})";

std::string with(const std::string& from, const std::string& to) {
  std::string json = kTriangle;
  const size_t at = json.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return json.replace(at, from.size(), to);
}

}  // namespace

TEST(GltfAttacks, TheUnchangedTriangleLoads) {
  const auto file = make_glb_container(kTriangle, std::vector<std::byte>(36));
  EXPECT_EQ(load_gltf({file, {}}, {}).report.vertices, 3u);
}

TEST(GltfAttacks, ThousandBuffersWithoutUriAreRefused) {
  std::string buffers = R"("buffers":[{"byteLength":36})";
  for (int i = 1; i < 1000; ++i) buffers += R"(,{"byteLength":1000000})";
  const auto json = with(R"("buffers":[{"byteLength":36}])", buffers + "]");
  EXPECT_EQ(refused(json, 1'000'000).where(), "/buffers/1");
}

TEST(GltfAttacks, DeepNestingIsRefused) {
  for (const char* place : {"extras", "extensions"}) {
    for (const size_t depth : {65u, 20'000u, 1'000'000u}) {
      std::string nested(depth, '[');
      nested += std::string(depth, ']');
      const auto json =
          with(R"("scene":0)", std::string("\"scene\":0,\"") + place + "\":" + nested);
      EXPECT_EQ(refused(json).code(), ErrorCode::too_large);
    }
  }
  // The control: nesting below the limit is passed over.
  const auto json =
      with(R"("scene":0)", R"("scene":0,"extras":)" + std::string(60, '[') + std::string(60, ']'));
  const auto file = make_glb_container(json, std::vector<std::byte>(36));
  EXPECT_NO_THROW(load_gltf({file, {}}, {}));
}

TEST(GltfAttacks, BufferOfNoBytesIsRefused) {
  EXPECT_EQ(
      refused(with(R"("buffers":[{"byteLength":36}])", R"("buffers":[{"byteLength":0}])")).where(),
      "/buffers/0/byteLength");
}

TEST(GltfAttacks, BufferLargerThanTheFileIsRefused) {
  auto json = with(R"("buffers":[{"byteLength":36}])", R"("buffers":[{"byteLength":4000000000}])");
  EXPECT_EQ(refused(json).where(), "/buffers/0/byteLength");
}

TEST(GltfAttacks, ImageViewOutOfRangeIsRefused) {
  for (const char* view : {R"({"buffer":0,"byteOffset":1000000000,"byteLength":16})",
                           R"({"buffer":0,"byteOffset":20,"byteLength":17})",
                           R"({"buffer":0,"byteOffset":18446744073709551615,"byteLength":2})",
                           R"({"buffer":0,"byteOffset":-4,"byteLength":2})"}) {
    const auto json = with(R"({"buffer":0,"byteLength":36})",
                           R"({"buffer":0,"byteLength":36},)" + std::string(view));
    const std::string images =
        json.substr(0, json.size() - 1) + R"(,"images":[{"bufferView":1,"mimeType":"image/png"}]})";
    EXPECT_EQ(refused(images).where().substr(0, 14), "/bufferViews/1") << view;
  }
}

TEST(GltfAttacks, UrisThatLeaveTheUploadAreRefused) {
  // A resource under each name proves that the name, and not its absence, is what is refused.
  const std::vector<std::byte> secret(36);
  for (const char* uri :
       {"/etc/hostname", "file:///etc/hostname", "http://example.org/a.bin", "../a.bin",
        "a/../../a.bin", "%2e%2e/a.bin", "%2Fetc/hostname", "..%5Ca.bin", "\\\\host\\a.bin",
        "C:\\a.bin", "a%00.bin", "a%zz.bin", "./../a.bin"}) {
    std::string escaped;
    for (const char* c = uri; *c; ++c) {
      if (*c == '\\') escaped += '\\';
      escaped += *c;
    }
    const auto json = with(R"("buffers":[{"byteLength":36}])",
                           R"("buffers":[{"byteLength":36,"uri":")" + escaped + "\"}]");
    const Error error = refused(bytes_of(json), {}, {{uri, secret}, {"a.bin", secret}});
    EXPECT_EQ(error.code(), ErrorCode::invalid_input) << uri;
    EXPECT_EQ(error.where(), "/buffers/0/uri") << uri << ": " << error.what();
  }
}

TEST(GltfAttacks, NamesInsideTheUploadAreFound) {
  const std::vector<std::byte> data(36);
  for (const auto& [uri, key] : std::map<std::string, std::string>{{"a.bin", "a.bin"},
                                                                   {"./a.bin", "a.bin"},
                                                                   {"sub/a b.bin", "sub/a b.bin"},
                                                                   {"sub/a%20b.bin", "sub/a b.bin"},
                                                                   {"%C3%A9.bin", "\xc3\xa9.bin"},
                                                                   {"a..b.bin", "a..b.bin"}}) {
    const auto json = bytes_of(with(R"("buffers":[{"byteLength":36}])",
                                    R"("buffers":[{"byteLength":36,"uri":")" + uri + "\"}]"));
    GltfSource source{json, {{key, data}}};
    EXPECT_NO_THROW(load_gltf(source, {})) << uri;
    source.resources.clear();
    const Error error = refused(json);
    EXPECT_NE(std::string(error.what()).find(key), std::string::npos) << error.what();
  }
}

TEST(GltfAttacks, SparseCountBelowZeroOrAboveTheAccessorIsRefused) {
  for (const char* count : {"-5", "4", "18446744073709551615", "0", "1.5"}) {
    const auto json =
        with(R"("count":3,"type":"VEC3")",
             R"("count":3,"type":"VEC3","sparse":{"count":)" + std::string(count) +
                 R"(,"indices":{"bufferView":0,"componentType":5121},"values":{"bufferView":0}})");
    EXPECT_EQ(refused(json).where(), "/accessors/0/sparse/count") << count;
  }
}

TEST(GltfAttacks, SparseIndicesThatDoNotRiseOrPassTheEndAreRefused) {
  const auto json = with(
      R"("count":3,"type":"VEC3")",
      R"("count":3,"type":"VEC3","sparse":{"count":2,)"
      R"("indices":{"bufferView":0,"byteOffset":24,"componentType":5121},"values":{"bufferView":0}})");
  const auto load = [&](int first, int second) {
    std::vector<std::byte> bin(36);
    bin[24] = static_cast<std::byte>(first);
    bin[25] = static_cast<std::byte>(second);
    const auto file = make_glb_container(json, bin);
    load_gltf({file, {}}, {});
  };
  EXPECT_NO_THROW(load(0, 2));
  EXPECT_THROW(load(2, 0), Error);
  EXPECT_THROW(load(1, 1), Error);
  EXPECT_THROW(load(1, 3), Error);
}

TEST(GltfAttacks, AccessorCountsThatCannotBeAreRefused) {
  for (const char* count : {"18446744073709551615", "1e300", "4", "-1", "2147483648", "0"}) {
    const auto json = with(R"("count":3)", R"("count":)" + std::string(count));
    EXPECT_EQ(refused(json).where().substr(0, 12), "/accessors/0") << count;
  }
  // Without a view an accessor holds zeros, as many as it says: bounded before anything is made.
  const auto json = with(R"("bufferView":0,"componentType":5126,"count":3)",
                         R"("componentType":5126,"count":1000000000000)");
  EXPECT_EQ(refused(json).code(), ErrorCode::too_large);
}

TEST(GltfAttacks, IndicesOfEverySectionAreChecked) {
  const std::pair<const char*, const char*> changes[] = {
      {R"("nodes":[0])", R"("nodes":[55])"},
      {R"("scene":0)", R"("scene":55)"},
      {R"({"mesh":0})", R"({"mesh":77})"},
      {R"({"mesh":0})", R"({"mesh":0,"skin":0})"},
      {R"({"mesh":0})", R"({"mesh":0,"children":[9]})"},
      {R"("POSITION":0)", R"("POSITION":99)"},
      {R"("POSITION":0})", R"("POSITION":0},"indices":99)"},
      {R"("POSITION":0})", R"("POSITION":0},"material":99)"},
      {R"("POSITION":0})", R"("POSITION":0},"targets":[{"POSITION":99}])"},
      {R"("POSITION":0})", R"("POSITION":0},"mode":7)"},
      {R"({"bufferView":0)", R"({"bufferView":99)"},
      {R"({"buffer":0)", R"({"buffer":99)"},
      {R"("count":3)", R"("byteOffset":4,"count":3)"},
      {R"("byteLength":36})", R"("byteLength":37})"},
  };
  for (const auto& [from, to] : changes) {
    EXPECT_EQ(refused(with(from, to)).code(), ErrorCode::invalid_input) << to;
  }
}

TEST(GltfAttacks, NodeThatIsItsOwnChildIsRefused) {
  const Error error = refused(with(R"({"mesh":0})", R"({"mesh":0,"children":[0]})"));
  EXPECT_EQ(error.where(), "/nodes/0/children/0");
  EXPECT_NE(std::string(error.what()).find("NODE_LOOP"), std::string::npos);
}

TEST(GltfAttacks, NodeChainsAreBoundedAt256) {
  const auto chain = [](int length) {
    std::string nodes = R"("nodes":[)";
    for (int i = 0; i + 1 < length; ++i)
      nodes += R"({"children":[)" + std::to_string(i + 1) + "]},";
    return make_glb_container(with(R"("nodes":[{"mesh":0}])", nodes + R"({"mesh":0}])"),
                              std::vector<std::byte>(36));
  };
  const auto longest = chain(256);
  EXPECT_NO_THROW(load_gltf({longest, {}}, {}));
  EXPECT_EQ(refused(chain(257)).code(), ErrorCode::too_large);
  EXPECT_EQ(refused(chain(100'000)).code(), ErrorCode::too_large);
}

TEST(GltfAttacks, ManyInstancesOfOneMeshAreBoundedBeforeTheyAreMade) {
  // 10,000 nodes each show a grid of 20,000 triangles: 200 million, ten times what is allowed.
  const auto grid = make_glb(make_grid(1, 100));
  std::string json(reinterpret_cast<const char*>(grid.data()) + 20);
  json.resize(json.find_last_of('}', json.find("BIN")) + 1);
  std::string nodes = "\"nodes\":[", roots;
  for (int i = 0; i < 10'000; ++i) {
    nodes += i == 0 ? R"({"mesh":0})" : R"(,{"mesh":0})";
    if (i != 0) roots += ',';
    roots += std::to_string(i);
  }
  json.replace(json.find("\"nodes\":[{\"mesh\":0}"), 19, nodes);
  json.replace(json.find("\"nodes\":[0]"), 11, "\"nodes\":[" + roots + "]");
  size_t bin = 20;
  std::memcpy(&bin, grid.data() + 12, 4);
  const auto file = make_glb_container(json, std::span(grid).subspan(28 + bin));
  GltfLoadOptions options;
  options.limits.max_triangles = 100'000;
  EXPECT_EQ(refused(file, options).code(), ErrorCode::too_large);
}

TEST(GltfAttacks, CompressedViewsThatClaimTooMuchAreRefused) {
  const auto json = [](const std::string& extension, uint64_t length) {
    return with(R"({"buffer":0,"byteLength":36})",
                R"({"buffer":0,"byteLength":)" + std::to_string(length) +
                    R"(,"extensions":{"EXT_meshopt_compression":)" + extension + "}}");
  };
  const char* bad[] = {
      R"({"buffer":0,"byteOffset":30,"byteLength":7,"byteStride":12,"count":3,"mode":"ATTRIBUTES"})",
      R"({"buffer":0,"byteLength":30,"byteStride":12,"count":4,"mode":"ATTRIBUTES"})",
      R"({"buffer":0,"byteLength":30,"byteStride":3,"count":12,"mode":"ATTRIBUTES"})",
      R"({"buffer":0,"byteLength":30,"byteStride":4,"count":9,"mode":"POINTS"})",
      R"({"buffer":0,"byteLength":30,"byteStride":12,"count":3,"mode":"ATTRIBUTES","filter":"QUATERNION"})",
      R"({"buffer":0,"byteLength":30,"byteStride":12,"count":3,"mode":"ATTRIBUTES","filter":"COLOR"})",
      R"({"buffer":0,"byteLength":30,"byteStride":12,"count":3,"mode":"ATTRIBUTES"})",
  };
  for (const char* extension : bad) {
    const Error error = refused(json(extension, 36));
    EXPECT_EQ(error.where().substr(0, 14), "/bufferViews/0") << extension << error.what();
  }
  std::string bomb = json(R"({"buffer":0,"byteLength":30,"byteStride":256,"count":40000000,)"
                          R"("mode":"ATTRIBUTES"})",
                          256ull * 40'000'000);
  bomb.replace(bomb.find(R"("buffers":[{"byteLength":36}])"), 29,
               R"("buffers":[{"byteLength":20000000000}])");
  EXPECT_EQ(refused(bomb).code(), ErrorCode::invalid_input);
}

TEST(GltfAttacks, DamagedDracoIsRefused) {
  const auto json = with(R"("POSITION":0})",
                         R"("POSITION":0},"indices":0,"extensions":{"KHR_draco_mesh_compression":)"
                         R"({"bufferView":0,"attributes":{"POSITION":0}}})");
  // The index accessor shares the float format, which is refused first; then the stream itself.
  EXPECT_EQ(refused(json).where(), "/meshes/0/primitives/0/indices");
  std::string proper = json;
  proper.replace(proper.find(R"("indices":0)"), 11, R"("indices":1)");
  proper.replace(proper.find(R"("type":"VEC3"})"), 14,
                 R"("type":"VEC3"},{"componentType":5123,"count":3,"type":"SCALAR"})");
  EXPECT_NE(std::string(refused(proper).what()).find("Draco"), std::string::npos);
}

TEST(GltfAttacks, RequiredExtensionsAreRefusedByName) {
  const Error error = refused(with(R"("scene":0)", R"("scene":0,"extensionsRequired":["ACME_x"])"));
  EXPECT_EQ(error.code(), ErrorCode::unsupported);
  EXPECT_EQ(error.where(), "/extensionsRequired/0");
  EXPECT_NE(std::string(error.what()).find("ACME_x"), std::string::npos);
  // Only used, it becomes a warning.
  const auto file = make_glb_container(
      with(R"("scene":0)", R"("scene":0,"extensionsUsed":["ACME_x"])"), std::vector<std::byte>(36));
  const Scene scene = load_gltf({file, {}}, {});
  ASSERT_FALSE(scene.report.warnings.empty());
  EXPECT_NE(scene.report.warnings[0].find("ACME_x"), std::string::npos);
}

TEST(GltfAttacks, RepeatedKeysAreRefused) {
  EXPECT_EQ(refused(with(R"("scene":0)", R"("scene":0,"scene":0)")).code(),
            ErrorCode::invalid_input);
}

TEST(GltfAttacks, OversizeJsonIsRefused) {
  GltfLoadOptions options;
  options.limits.max_json_bytes = 100;
  EXPECT_EQ(refused(make_glb_container(kTriangle, std::vector<std::byte>(36)), options).code(),
            ErrorCode::too_large);
  std::string many = R"("extras":[0)";
  for (int i = 0; i < 4'100'000; ++i) many += ",0";
  EXPECT_EQ(refused(with(R"("scene":0)", many + R"(],"scene":0)")).code(), ErrorCode::too_large);
}

TEST(GltfUri, Base64IsReadStrictly) {
  const auto text = [](const std::string& uri) {
    const auto bytes = decode_data_uri(uri, "");
    return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  EXPECT_EQ(text("data:application/octet-stream;base64,SGVsbG8="), "Hello");
  EXPECT_EQ(text("data:;base64,SGVsbG8"), "Hello");
  EXPECT_EQ(text("data:a/b;x=y;base64,SGVsbG8h"), "Hello!");
  EXPECT_EQ(text("data:;base64,"), "");
  for (const char* bad : {"data:,Hello", "data:;base64", "data:;base64,SGVsbG8==", "data:;base64,S",
                          "data:;base64,SGVs bG8=", "data:;base64,SG=sbG8="}) {
    EXPECT_THROW(decode_data_uri(bad, ""), Error) << bad;
  }
}
