// What a page of jobs may weigh.

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/http/raw_client.h"
#include "tests/http/service.h"

namespace lightkiln::test {
namespace {

TEST(List, AListCarriesNoSpecs) {
  Service service;
  const std::string id = service.submit();
  const JobPage page = read_job_page(get(service.port, "/v1/jobs").body);
  ASSERT_EQ(page.items.size(), 1u);
  EXPECT_EQ(page.items[0].spec_json, "");
  EXPECT_NE(page.items[0].spec_digest, "");
  EXPECT_NE(read_job(get(service.port, "/v1/jobs/" + id).body).spec_json, "");
}

TEST(List, APageOfLargeJobsEndsEarlyAndTheNextGoesOn) {
  Service service;
  Submission submission;
  submission.kind = "ambient_occlusion";
  submission.labels = {{"large", std::string(300000, 'x')}};
  std::vector<std::string> ids, seen;
  for (int i = 0; i < 21; ++i) {
    submission.spec_digest = "digest " + std::to_string(i);
    submission.spec_json = "{\"large\":\"" + std::string(100000, 'y') + "\"}";
    ids.insert(ids.begin(), service.store->submit(submission).job_id);
  }
  std::string after;
  do {
    const RawReply reply = get(service.port, "/v1/jobs?limit=500" + after);
    EXPECT_LT(reply.body.size(), (1u << 20) + 310000u);
    const JobPage page = read_job_page(reply.body);
    for (const JobMessage& job : page.items) seen.push_back(job.id);
    after = page.next.empty() ? "" : "&after=" + page.next;
  } while (!after.empty() && seen.size() <= ids.size());
  EXPECT_EQ(seen, ids);
}

}  // namespace
}  // namespace lightkiln::test
