/* LatestValue of latest_value.h, with the names used there. Runs are endless. The writer writes "old" values as long
 * as it likes and then "new" ones for ever: the code never looks at a value, so if there were a run in which some value
 * is followed by an earlier one, there would be one in which a new value is followed by an old one. Memory: see
 * weak_memory.pml; the middle is only exchanged, so one message is alive at a time.
 *
 * Checked: the slots of writer, middle and reader are three different ones; no access to a slot is a race, no value is
 * torn; a fresh value is the newest one published; values never go back; null exactly as long as no value has been
 * taken; a published value, or a newer one, is read some time. */
#define SLOTS 3
#define THREADS 2
#define MESSAGES 1
#include "weak_memory.pml"

#ifndef kSwap
#define kSwap ACQ_REL
#endif
#ifndef kSwapInPublish /* the two exchanges, to be weakened one at a time */
#define kSwapInPublish kSwap
#endif
#ifndef kSwapInRead
#define kSwapInRead kSwap
#endif

#define kWriter 0
#define kReader 1
#define kFresh 4
#define kSlotMask 3

#define kNothing 0
#define kOld 1
#define kNew 2
#define kBeingWritten 3

byte middle = 1, writer_slot = 0, reader_slot = 2;
bit fresh_visible; /* what the hint in read() returns */
bit has_value;
byte value[SLOTS] = kNothing;
byte published = kNothing, last_read = kNothing;

/* A store reaches the other side some time. */
active proctype memory() {
  do
  :: atomic { (middle & kFresh) && !fresh_visible -> fresh_visible = 1 }
  od
}

active proctype writer() {
  byte serial = kOld, taken;
  do
  :: if
     :: serial = kNew
     :: skip
     fi;
     /* draft() */
     atomic {
       access(kWriter, writer_slot, access_of(kReader, writer_slot));
       value[writer_slot] = kBeingWritten
     };
     atomic {
       access(kWriter, writer_slot, access_of(kReader, writer_slot));
       value[writer_slot] = serial
     };
     /* publish() */
     atomic {
       modifying(kWriter, 0, kSwapInPublish);
       taken = middle & kSlotMask;
       middle = writer_slot | kFresh;
       writer_slot = taken;
       published = serial;
       assert(writer_slot != reader_slot && (middle & kSlotMask) != writer_slot)
     }
  od
}

active proctype reader() {
  byte taken;
  do
  :: /* read() */
     if
     :: fresh_visible ->
        atomic {
          modifying(kReader, 0, kSwapInRead);
          assert(middle & kFresh);
          taken = middle & kSlotMask;
          middle = reader_slot;
          reader_slot = taken;
          fresh_visible = 0;
          has_value = 1;
          assert(reader_slot != writer_slot && value[reader_slot] == published)
        }
     :: else
     fi;
     if
     :: has_value ->
        /* the value is looked at twice, and is whole and the same both times */
        atomic {
          access(kReader, reader_slot, access_of(kWriter, reader_slot));
          assert(value[reader_slot] == kOld || value[reader_slot] == kNew);
          assert(value[reader_slot] >= last_read);
          last_read = value[reader_slot]
        };
        atomic {
          access(kReader, reader_slot, access_of(kWriter, reader_slot));
          assert(value[reader_slot] == last_read)
        }
     :: else -> assert(last_read == kNothing)
     fi
  od
}

ltl is_read { [] ((published == kNew) -> <> (last_read == kNew)) && [] ((published != kNothing) -> <> has_value) }
